#include "libeditnerf/geometry/se3.h"

#include <ATen/ATen.h>

#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr double kSeriesBelow = 1.0;  // theta^2 under which the series is used
constexpr int kSeriesTerms = 9;       // the tenth is below 1e-17 at theta^2 = 1

// sum_n (-x)^n / (2 n + first)!
torch::Tensor Series(const torch::Tensor& x, int first) {
  double coefficients[kSeriesTerms];
  double factorial = 1;
  for (int i = 2; i <= first; ++i) factorial *= i;
  for (int n = 0; n < kSeriesTerms; ++n) {
    coefficients[n] = (n % 2 == 0 ? 1 : -1) / factorial;
    factorial *= (2.0 * n + first + 1) * (2.0 * n + first + 2);
  }
  torch::Tensor sum = torch::full_like(x, coefficients[kSeriesTerms - 1]);
  for (int n = kSeriesTerms - 2; n >= 0; --n) sum = sum * x + coefficients[n];
  return sum;
}

torch::Tensor Cross(const torch::Tensor& a, const torch::Tensor& b) { return at::linalg_cross(a, b); }

ScrewCoefficients CoefficientsFor(const torch::Tensor& w) {
  return ScrewCoefficientsOf(w.square().sum(-1, /*keepdim=*/true));
}

}  // namespace

ScrewCoefficients ScrewCoefficientsOf(const torch::Tensor& theta_squared) {
  const torch::Tensor small = theta_squared < kSeriesBelow;
  const torch::Tensor near = torch::where(small, theta_squared, torch::zeros_like(theta_squared));
  const torch::Tensor far = torch::where(small, torch::ones_like(theta_squared), theta_squared);
  const torch::Tensor theta = far.sqrt();
  const torch::Tensor sine = theta.sin();
  const torch::Tensor half_sine = (0.5 * theta).sin();  // 1 - cos(theta) = 2 sin^2(theta / 2) without cancellation
  return {torch::where(small, Series(near, 1), sine / theta),
          torch::where(small, Series(near, 2), 2 * half_sine.square() / far),
          torch::where(small, Series(near, 3), (theta - sine) / (far * theta))};
}

torch::Tensor ExpSe3(const torch::Tensor& w, const torch::Tensor& v, const torch::Tensor& x) {
  CheckLastDim(w, 3, "w");
  CheckLastDim(v, 3, "v");
  CheckLastDim(x, 3, "x");
  const ScrewCoefficients k = CoefficientsFor(w);
  const torch::Tensor w_x = Cross(w, x);
  return x + v + k.a * w_x + k.b * Cross(w, w_x + v) + k.c * Cross(w, Cross(w, v));
}

torch::Tensor ExpSo3(const torch::Tensor& w, const torch::Tensor& x) {
  CheckLastDim(w, 3, "w");
  CheckLastDim(x, 3, "x");
  const ScrewCoefficients k = CoefficientsFor(w);
  const torch::Tensor w_x = Cross(w, x);
  return x + k.a * w_x + k.b * Cross(w, w_x);
}

}  // namespace editnerf
