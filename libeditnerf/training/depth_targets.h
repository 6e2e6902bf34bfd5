// Distances that are known before training, at some pixels of the training frames.
#pragma once

#include <torch/types.h>

namespace editnerf {

struct DepthTargets {
  torch::Tensor frame;      // [M] int64, training frames in time order
  torch::Tensor pixel;      // [M, 2] int64, column and row
  torch::Tensor distance;   // [M] float32, from the camera centre, scene units
  torch::Tensor tolerance;  // [M] float32, share of the distance within which any is as good

  int64_t size() const { return distance.defined() ? distance.size(0) : 0; }
};

}  // namespace editnerf
