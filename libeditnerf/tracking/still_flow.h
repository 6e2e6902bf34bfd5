// The flow that cameras and depth explain if nothing moved.
#pragma once

#include <torch/types.h>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

// From the image of `from` to that of `to`; depth [H, W] float32, distance along the ray in scene units, of the first
// -> [H, W, 2] float32. Where there is no depth, or the point leaves the second camera's view, the median of the
// others (0 without any).
torch::Tensor StillFlow(const Camera& from, const torch::Tensor& depth, const Camera& to);

}  // namespace editnerf
