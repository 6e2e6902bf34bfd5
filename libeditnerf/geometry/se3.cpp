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

// An angle with what the coefficients are made of: the series near 0, quotients elsewhere.
class Angle {
 public:
  explicit Angle(const torch::Tensor& theta_squared)
      : small_(theta_squared < kSeriesBelow),
        near_(torch::where(small_, theta_squared, torch::zeros_like(theta_squared))),
        far_(torch::where(small_, torch::ones_like(theta_squared), theta_squared)),
        theta_(far_.sqrt()),
        sine_(theta_.sin()) {}

  torch::Tensor A() const { return torch::where(small_, Series(near_, 1), sine_ / theta_); }
  torch::Tensor B() const {
    const torch::Tensor half_sine = (0.5 * theta_).sin();  // 1 - cos(theta) = 2 sin^2(theta / 2) without cancellation
    return torch::where(small_, Series(near_, 2), 2 * half_sine.square() / far_);
  }
  torch::Tensor C() const { return torch::where(small_, Series(near_, 3), (theta_ - sine_) / (far_ * theta_)); }

 private:
  torch::Tensor small_, near_, far_, theta_, sine_;
};

torch::Tensor SquareOf(const torch::Tensor& w) { return w.square().sum(-1, /*keepdim=*/true); }

}  // namespace

ScrewCoefficients ScrewCoefficientsOf(const torch::Tensor& theta_squared) {
  const Angle angle(theta_squared);
  return {angle.A(), angle.B(), angle.C()};
}

torch::Tensor ExpSe3(const torch::Tensor& w, const torch::Tensor& v, const torch::Tensor& x) {
  CheckLastDim(w, 3, "w");
  CheckLastDim(v, 3, "v");
  CheckLastDim(x, 3, "x");
  const ScrewCoefficients k = ScrewCoefficientsOf(SquareOf(w));
  const torch::Tensor w_x = Cross(w, x);
  return x + v + k.a * w_x + k.b * Cross(w, w_x + v) + k.c * Cross(w, Cross(w, v));
}

torch::Tensor ExpSo3(const torch::Tensor& w, const torch::Tensor& x) {
  CheckLastDim(w, 3, "w");
  CheckLastDim(x, 3, "x");
  const Angle angle(SquareOf(w));
  const torch::Tensor w_x = Cross(w, x);
  return x + angle.A() * w_x + angle.B() * Cross(w, w_x);
}

}  // namespace editnerf
