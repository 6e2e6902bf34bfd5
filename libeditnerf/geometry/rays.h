// Rays through pixel positions.
#pragma once

#include <torch/types.h>

#include "libeditnerf/geometry/camera_tensors.h"

namespace editnerf {

struct Rays {
  torch::Tensor origin;     // [R, 3], the camera centre, scene units
  torch::Tensor direction;  // [R, 3], unit length, scene frame
};

// frame [R] int64, rows of `cameras`; pixel [R, 2] positions (u, v), centres at +0.5 -> rays in the cameras' dtype.
// The inverse of ProjectPoints; agrees with Camera::DirectionThrough. Throws ShapeError.
Rays RaysThroughPixels(const CameraTensors& cameras, const torch::Tensor& frame, const torch::Tensor& pixel);

}  // namespace editnerf
