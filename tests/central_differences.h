// Gradients checked against central differences in double precision.
#pragma once

#include <torch/torch.h>

#include <algorithm>
#include <functional>

namespace editnerf {

// The largest difference between autograd's gradient of the scalar `function` at `at` (float64) and central differences
// with the given step, relative to the larger of 1 and the largest gradient.
inline double GradientError(const std::function<torch::Tensor(const torch::Tensor&)>& function, const torch::Tensor& at,
                            double step = 1e-6) {
  const auto x = at.detach().clone().requires_grad_(true);
  const auto gradient = torch::autograd::grad({function(x)}, {x})[0].flatten();
  auto moved = at.detach().clone().contiguous();
  auto flat = moved.view({-1});
  torch::NoGradGuard no_grad;
  double worst = 0, scale = 1;
  for (int64_t i = 0; i < flat.size(0); ++i) {
    const double value = flat[i].item<double>();
    flat[i] = value + step;
    const double above = function(moved).item<double>();
    flat[i] = value - step;
    const double below = function(moved).item<double>();
    flat[i] = value;
    const double expected = gradient[i].item<double>();
    const double difference = std::abs((above - below) / (2 * step) - expected);
    worst = difference <= worst ? worst : difference;  // NaN counts as worst
    scale = std::max(scale, std::abs(expected));
  }
  return worst / scale;
}

}  // namespace editnerf
