// A small clip with exact truth for the trackers' tests: textured spheres over a textured floor, a camera on an arc,
// and what an ideal pretrained field would give: exact depth, and ambient coordinates that follow each part's state.
#pragma once

#include <torch/types.h>

#include <functional>
#include <optional>
#include <vector>

#include "libeditnerf/scene/scene.h"
#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/pretrained_maps.h"

namespace editnerf {

struct Sphere {
  double radius = 0.2;
  std::function<Vec3(int64_t)> center;     // scene units; floor at z = 0, camera towards +y and down
  std::function<Mat3(int64_t)> turn = {};  // from its own axes to the scene's; none where it is empty
};

struct ClipOptions {
  int64_t frames = 30, width = 160, height = 120;
  double arc = 0.25;            // radians that the camera travels
  double ambient_noise = 0.02;  // standard deviation
  double depth_noise = 0;       // standard deviation, share of the depth
  std::optional<Vec3> lamp{};   // towards light from afar, unit length; the floor in its shade is half as light
};

struct MovingSpheres {
  Scene scene;
  PretrainedMaps maps;
  torch::Tensor part;  // [T, H, W] int64: -1 floor, otherwise the sphere's number

  // Number of the sphere, or -1, at a scene point's pixel in a training frame; -2 outside the image.
  int64_t PartAt(int64_t frame, const Vec3& point) const;
};

MovingSpheres RenderMovingSpheres(const std::vector<Sphere>& spheres, const ClipOptions& options = {});

// Cameras, images in colour and grey, and depth; no flow.
Clip ClipWithoutFlow(const MovingSpheres& rendered);

// A sphere that slides to and fro along a direction: center + amplitude sin(2 pi cycles t / frames).
Sphere Sliding(const Vec3& center, const Vec3& amplitude, double cycles, int64_t frames, double radius = 0.2);
Sphere Resting(const Vec3& center, double radius = 0.2);

inline Vec3 RowOf(const torch::Tensor& points, int64_t row) {
  const float* p = points.contiguous().data_ptr<float>() + 3 * row;
  return {p[0], p[1], p[2]};
}

}  // namespace editnerf
