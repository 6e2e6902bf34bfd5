// Derivatives against central differences in float64, along random directions.
#pragma once

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace editnerf {

// Largest deviation, relative to max(1, |difference quotient|), between autograd's directional derivative of a random
// projection of f() and its central difference. `leaves` are float64 tensors that f reads and that require gradients
// (inputs or a module's parameters); they keep their values, their gradients are overwritten. NaN when a gradient is
// not finite.
inline double GradientError(const std::function<torch::Tensor()>& f, const std::vector<torch::Tensor>& leaves,
                            double step = 1e-6, int directions = 4) {
  const torch::Tensor value = f();
  const torch::Tensor projection = torch::randn(value.sizes(), torch::kFloat64);
  for (torch::Tensor leaf : leaves) leaf.mutable_grad() = torch::Tensor();
  (value * projection).sum().backward();
  const auto project = [&] { return (f() * projection).sum().item<double>(); };
  const torch::NoGradGuard no_grad;
  double worst = 0;
  for (int i = 0; i < directions; ++i) {
    double expected = 0;
    std::vector<torch::Tensor> direction, kept;
    for (const torch::Tensor& leaf : leaves) {
      direction.push_back(torch::randn(leaf.sizes(), torch::kFloat64));
      kept.push_back(leaf.clone());
      if (leaf.grad().defined()) expected += (leaf.grad() * direction.back()).sum().item<double>();
    }
    const auto move = [&](double amount) {
      for (size_t k = 0; k < leaves.size(); ++k) torch::Tensor(leaves[k]).copy_(kept[k] + amount * direction[k]);
    };
    move(step);
    const double ahead = project();
    move(-step);
    const double behind = project();
    move(0);
    const double found = (ahead - behind) / (2 * step);
    const double error = std::abs(found - expected) / std::max(1.0, std::abs(found));
    if (!std::isfinite(error)) return error;
    worst = std::max(worst, error);
  }
  return worst;
}

// A float64 leaf that requires gradients.
inline torch::Tensor Leaf(const torch::Tensor& values) {
  return values.to(torch::kFloat64).detach().clone().set_requires_grad(true);
}

}  // namespace editnerf
