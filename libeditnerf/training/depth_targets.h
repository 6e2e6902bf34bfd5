// Distances that are known before training, at some pixels of the training frames.
#pragma once

#include <torch/types.h>

#include <filesystem>

namespace editnerf {

// Instead of a key point's number.
constexpr int64_t kStandsStill = -1;
constexpr int64_t kNotCarried = -2;  // on a part without a key point, or that rests
constexpr int64_t kOtherLight = -3;  // stands still, under a shadow that passes

struct DepthTargets {
  torch::Tensor frame;      // [M] int64, training frames in time order
  torch::Tensor pixel;      // [M, 2] int64, column and row
  torch::Tensor distance;   // [M] float32, from the camera centre, scene units
  torch::Tensor tolerance;  // [M] float32, share of the distance within which any is as good
  torch::Tensor key_point;  // [M] int64, the key point that carries the place along, or one of the above

  int64_t size() const { return distance.defined() ? distance.size(0) : 0; }
};

// Both, one after the other; either may be empty.
DepthTargets Joined(const DepthTargets& a, const DepthTargets& b);

// A safetensors file with the five tensors. Reading throws CheckpointError or DataError naming the file where it is
// broken, holds what is not finite and positive, or does not fit `frames` images of the given size and `key_points` key
// points.
void WriteDepthTargets(const std::filesystem::path& path, const DepthTargets& targets);
DepthTargets ReadDepthTargets(const std::filesystem::path& path, int64_t frames, int64_t height, int64_t width,
                              int64_t key_points);

}  // namespace editnerf
