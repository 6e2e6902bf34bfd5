#include "libeditnerf/geometry/distortion.h"

#include <ATen/core/grad_mode.h>

namespace editnerf {
namespace {

constexpr int kIterations = 20;
constexpr double kTolerance = 1e-12;  // of the image plane coordinates, at which a point is done
constexpr double kAcceptable = 1e-6;  // error that is still a solution after the last iteration
constexpr double kFold = 1e-9;        // Jacobian determinant at which there is no inverse

struct Terms {
  torch::Tensor x, y, r2, radial;
  torch::Tensor k1, k2, k3, t1, t2;

  Terms(const DistortionRows& c, const torch::Tensor& plane)
      : x(plane.select(-1, 0)),
        y(plane.select(-1, 1)),
        r2(x * x + y * y),
        k1(c.radial.select(-1, 0)),
        k2(c.radial.select(-1, 1)),
        k3(c.radial.select(-1, 2)),
        t1(c.tangential.select(-1, 0)),
        t2(c.tangential.select(-1, 1)) {
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  }
  torch::Tensor Xd() const { return x * radial + 2 * t1 * x * y + t2 * (r2 + 2 * x * x); }
  torch::Tensor Yd() const { return y * radial + 2 * t2 * x * y + t1 * (r2 + 2 * y * y); }
};

}  // namespace

torch::Tensor Distort(const DistortionRows& coefficients, const torch::Tensor& plane) {
  const Terms terms(coefficients, plane);
  return torch::stack({terms.Xd(), terms.Yd()}, -1);
}

torch::Tensor Undistort(const DistortionRows& coefficients, const torch::Tensor& distorted) {
  const torch::NoGradGuard no_grad;
  const DistortionRows c{coefficients.radial.to(torch::kFloat64), coefficients.tangential.to(torch::kFloat64)};
  const torch::Tensor target = distorted.to(torch::kFloat64);
  const torch::Tensor target_x = target.select(-1, 0), target_y = target.select(-1, 1);
  torch::Tensor plane = target;
  torch::Tensor folded = torch::zeros_like(target_x, torch::kBool);
  torch::Tensor error;
  for (int i = 0;; ++i) {
    const Terms terms(c, plane);
    const torch::Tensor ex = terms.Xd() - target_x, ey = terms.Yd() - target_y;
    error = ex.abs() + ey.abs();
    const torch::Tensor active = ~folded & ~(error < kTolerance);
    if (i == kIterations || !active.any().item<bool>()) break;
    const torch::Tensor slope = terms.k1 + terms.r2 * (2 * terms.k2 + 3 * terms.r2 * terms.k3);  // d radial / d r2
    const torch::Tensor xy = terms.x * terms.y;
    const torch::Tensor j0 =
        terms.radial + 2 * terms.x * terms.x * slope + 2 * terms.t1 * terms.y + 6 * terms.t2 * terms.x;
    const torch::Tensor j1 = 2 * xy * slope + 2 * terms.t1 * terms.x + 2 * terms.t2 * terms.y;
    const torch::Tensor j3 =
        terms.radial + 2 * terms.y * terms.y * slope + 2 * terms.t2 * terms.x + 6 * terms.t1 * terms.y;
    const torch::Tensor determinant = j0 * j3 - j1 * j1;  // the Jacobian is symmetric
    const torch::Tensor regular = determinant.abs() > kFold;
    folded = folded | (active & ~regular);
    const torch::Tensor moving = active & regular;
    const torch::Tensor divisor = torch::where(moving, determinant, torch::ones_like(determinant));
    const torch::Tensor step = torch::stack({j3 * ex - j1 * ey, j0 * ey - j1 * ex}, -1) / divisor.unsqueeze(-1);
    plane = torch::where(moving.unsqueeze(-1), plane - step, plane);
  }
  const torch::Tensor solved = ~folded & (error < kAcceptable);
  return torch::where(solved.unsqueeze(-1), plane, target).to(distorted.scalar_type());
}

}  // namespace editnerf
