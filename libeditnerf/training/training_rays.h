// Random rays of the training images, with the colours that they should have.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/geometry/camera_tensors.h"
#include "libeditnerf/geometry/rays.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/depth_targets.h"
#include "libeditnerf/training/error_map.h"

namespace editnerf {

struct RayTargets {
  Rays rays;                          // [R]
  torch::Tensor frame;                // [R] int64, rows of the list that the sampler was made of
  torch::Tensor pixel;                // [R] int64, counted through all images row by row
  torch::Tensor target;               // [R, 3], colours in [0, 1]
  torch::Tensor emphasis;             // [R], what each ray's colours count for; undefined: all for 1
  torch::Tensor distance, tolerance;  // [R], of DepthTargets, NaN where unknown; undefined without any
  // The last `drawn` rays go through known places. From `start` on they show the same whatever state the scene is in,
  // but for its light, if they go along with the key point that carries the place.
  int64_t drawn = 0;
  torch::Tensor start;    // [R], 0 for the other rays; undefined without any
  torch::Tensor carrier;  // [drawn] int64, the key point that carries the place, or below 0
  torch::Tensor place;    // [drawn, 3], scene units
};

class TrainingRays {
 public:
  // The pixels of the scene's frames `frames` (indices into scene.frames); images stay 8 bit on `device`.
  TrainingRays(const Scene& scene, const std::vector<int64_t>& frames, torch::Device device);

  // From now on a quarter of the rays goes through pixels of known distance.
  void SetDepthTargets(const DepthTargets& targets);

  // From now on these shares of the rays, together at most three quarters, go through the places that stand still and
  // through those that a key point carries. Under passing shadows (kOtherLight) too, with `any_light`.
  void SetKnownPlaces(const DepthTargets& places, double still_share, double carried_share, bool any_light = false);

  // From now on this share of the other rays, below 1, goes through cells drawn by how far off they are.
  void DrawByError(double share);
  ErrorMap* errors() { return errors_ ? &*errors_ : nullptr; }

  // What the rays of a batch have missed their colours by, squared, [R]. Those through known places say nothing, as
  // they show states that no image has. Nothing without DrawByError.
  void Learn(const RayTargets& batch, const torch::Tensor& missed);

  // Where known places are, [M, 3], scene units.
  torch::Tensor Positions(const DepthTargets& places) const;

  // `count` pixels, with repetition, from LibTorch's default CPU generator.
  RayTargets Sample(int64_t count) const;

  // Frame, rays and colours of pixels [R] int64, counted through all images row by row.
  RayTargets Through(const torch::Tensor& pixel) const;

  const CameraTensors& cameras() const { return cameras_; }
  const torch::Tensor& mean_color() const { return mean_color_; }  // [3], of all pixels

 private:
  struct KnownPlaces {
    double share = 0;                          // of the rays
    torch::Tensor pixel, distance, key_point;  // [S] int64, float32, int64
  };

  torch::Tensor PixelsOf(const DepthTargets& places) const;
  KnownPlaces Where(const DepthTargets& places, const torch::Tensor& chosen, double share) const;

  std::vector<Camera> each_camera_;
  CameraTensors cameras_;
  torch::Tensor images_;      // [F, H, W, 3] uint8
  torch::Tensor mean_color_;  // [3]
  DepthTargets targets_;
  torch::Tensor target_pixel_;  // [M] int64 into all pixels
  KnownPlaces still_, carried_;
  std::optional<ErrorMap> errors_;
};

}  // namespace editnerf
