// A loaded scene: cameras, images, splits, and ground truth where the scene is synthetic.
//
// Everything is in scene units: scene = (world - center) * scale. World units appear only in files.
#pragma once

#include <torch/types.h>

#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

// scene.json.
struct SceneTransform {
  double scale = 1;
  Vec3 center;                 // world
  double near = 0.1, far = 2;  // scene units
};

struct SceneFrame {
  std::string id;
  int64_t warp_id = -1;  // the object state's number in time order; -1 for edit frames, which have none
  int64_t appearance_id = -1;
  Camera camera;  // scene units, at the size of `images`
};

// Exact truth of a synthetic scene, one row per frame of the scene.
struct GroundTruth {
  std::vector<std::string> objects;  // O names
  torch::Tensor scene_from_object;   // [F, O, 4, 4] float64, scene units
  torch::Tensor depth;  // [F, H, W] float32, distance from the camera centre, scene units; inf: nothing hit
  torch::Tensor mask;   // [F, H, W] uint8, 0 static, k + 1 the k-th object
};

struct Scene {
  std::string name;
  SceneTransform transform;
  std::vector<SceneFrame> frames;
  std::vector<int64_t> train;  // indices into frames, in time order
  std::vector<int64_t> val;    // known object states (reconstruction) or held-out times (interpolation)
  std::vector<int64_t> edit;   // object states that training never saw
  torch::Tensor images;        // [F, H, W, 3] uint8, RGB
  torch::Tensor points;        // [P, 3] float32 background points, scene units; undefined if unknown
  std::optional<GroundTruth> truth;

  int64_t height() const { return images.size(1); }
  int64_t width() const { return images.size(2); }

  // Index of the frame with this id; throws DataError naming it and the scene.
  int64_t FrameIndex(const std::string& id) const;

  // Throws DataError naming what is inconsistent: sizes, splits, fewer than two training frames, near >= far.
  void Check() const;
};

}  // namespace editnerf
