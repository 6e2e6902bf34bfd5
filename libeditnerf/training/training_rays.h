// Random rays of the training images, with the colours that they should have.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "libeditnerf/geometry/camera_tensors.h"
#include "libeditnerf/geometry/rays.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

struct RayTargets {
  Rays rays;                          // [R]
  torch::Tensor frame;                // [R] int64, rows of the list that the sampler was made of
  torch::Tensor target;               // [R, 3], colours in [0, 1]
  torch::Tensor distance, tolerance;  // [R], of DepthTargets, NaN where unknown; undefined without any
  // The last `still` rays go through places that stand still. From `start` on they show the same whatever state the
  // scene is in.
  int64_t still = 0;
  torch::Tensor start;  // [R], 0 for the other rays; undefined without any
};

class TrainingRays {
 public:
  // The pixels of the scene's frames `frames` (indices into scene.frames); images stay 8 bit on `device`.
  TrainingRays(const Scene& scene, const std::vector<int64_t>& frames, torch::Device device);

  // From now on a quarter of the rays goes through pixels of known distance.
  void SetDepthTargets(const DepthTargets& targets);

  // From now on this share of the rays, at most three quarters, goes through places that stand still.
  void SetStillPlaces(const DepthTargets& places, double share);

  // `count` pixels drawn uniformly, with repetition, from LibTorch's default CPU generator.
  RayTargets Sample(int64_t count) const;

  const CameraTensors& cameras() const { return cameras_; }
  const torch::Tensor& mean_color() const { return mean_color_; }  // [3], of all pixels

 private:
  torch::Tensor PixelsOf(const DepthTargets& places) const;

  CameraTensors cameras_;
  torch::Tensor images_;      // [F, H, W, 3] uint8
  torch::Tensor mean_color_;  // [3]
  DepthTargets targets_;
  torch::Tensor target_pixel_;  // [M] int64 into all pixels
  double still_share_ = 0;
  torch::Tensor still_pixel_, still_distance_;  // [S] int64 and float32
};

}  // namespace editnerf
