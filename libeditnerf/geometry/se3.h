// Rigid motions from their screw axes: the exponential maps of SO(3) and SE(3), safe at every angle.
//
// With theta = |w| and [w] the cross product matrix of w:
//   exp(w, v): x -> R x + G v,   R = I + A [w] + B [w]^2,   G = I + B [w] + C [w]^2
//   A = sin(theta) / theta,   B = (1 - cos(theta)) / theta^2,   C = (theta - sin(theta)) / theta^3
// A, B and C are evaluated as functions of theta^2, and their power series is selected before any division, so that
// values and gradients are exact at theta = 0: there x -> x + v, with the derivative w x (x + v / 2) along w.
//
// Anchor: w = (0, 0, pi/2), v = 0 maps (1, 0, 0) to (0, 1, 0).
#pragma once

#include <torch/types.h>

namespace editnerf {

struct ScrewCoefficients {
  torch::Tensor a, b, c;
};

// theta_squared [...], >= 0 -> coefficients of the same shape. At 0: 1, 1/2, 1/6.
ScrewCoefficients ScrewCoefficientsOf(const torch::Tensor& theta_squared);

// w [..., 3] rotation part (radians), v [..., 3] translation part, x [..., 3] -> the moved point, broadcast.
// Throws ShapeError unless the last dimensions are 3.
torch::Tensor ExpSe3(const torch::Tensor& w, const torch::Tensor& v, const torch::Tensor& x);

// The same without translation: R x.
torch::Tensor ExpSo3(const torch::Tensor& w, const torch::Tensor& x);

}  // namespace editnerf
