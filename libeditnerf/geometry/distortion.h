// Radial and tangential distortion of points on the image plane (z = 1), in tensors.
//
// With r2 = x^2 + y^2 and g = 1 + k1 r2 + k2 r2^2 + k3 r2^3:
//   xd = x g + 2 t1 x y + t2 (r2 + 2 x^2),   yd = y g + 2 t2 x y + t1 (r2 + 2 y^2)
#pragma once

#include <torch/types.h>

namespace editnerf {

struct DistortionRows {
  torch::Tensor radial;      // [R, 3]
  torch::Tensor tangential;  // [R, 2]
};

// plane [R, 2] -> distorted [R, 2]; differentiable.
torch::Tensor Distort(const DistortionRows& coefficients, const torch::Tensor& plane);

// The inverse by Newton's method in float64. Where it does not converge the input is returned, as by
// Camera::DirectionThrough. Not differentiable: the result is a constant.
torch::Tensor Undistort(const DistortionRows& coefficients, const torch::Tensor& distorted);

}  // namespace editnerf
