// What supervises the key points: optical flow and depth of the training frames (EditableNeRF, eq. (5) and (6)).
#pragma once

#include <torch/types.h>

namespace editnerf {

struct KeyPointSupervision {
  torch::Tensor flow;   // [T - 1, H, W, 2] float32, pixels, from each training frame to the next; NaN where unknown
  torch::Tensor depth;  // [T, H, W] float32, distance along the ray, scene units; NaN where there is no surface
};

}  // namespace editnerf
