#include "libeditnerf/field/positional_encoding.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/sinusoids.h"

namespace editnerf {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Octaves are integer multiples of the first frequency, so that whole periods may be taken off before they multiply.
// Nothing changes within one period of zero, where scenes lie; the shift is a constant for the gradient.
torch::Tensor WithinOnePeriod(const torch::Tensor& x) { return x - (x.detach() * (0.5 / kPi)).round_().mul_(2 * kPi); }

bool InOnePeriod(const torch::Tensor& x) { return x.numel() == 0 || x.detach().abs().max().item<double>() <= kPi; }

std::vector<float> WindowWeights(std::optional<double> alpha, int64_t octaves) {
  std::vector<float> weights;
  for (int64_t k = 0; k < octaves; ++k) {
    const double open = alpha ? std::clamp(*alpha - static_cast<double>(k), 0.0, 1.0) : 1.0;
    weights.push_back(static_cast<float>(0.5 * (1 - std::cos(kPi * open))));
  }
  return weights;
}

// 1, 2, 4, ...: exact on every device, unlike pow.
torch::Tensor Frequencies(int64_t count, const torch::TensorOptions& options) {
  return torch::full({count}, 2.0, options).cumprod(0).mul_(0.5);
}

}  // namespace

PositionalEncoding::PositionalEncoding(int64_t dim, int64_t num_octaves, bool include_identity)
    : dim_(dim), num_octaves_(num_octaves), include_identity_(include_identity) {
  if (dim < 1) Throw<ConfigError>("positional encoding: expected at least one dimension, found {}", dim);
  if (num_octaves < 0)
    Throw<ConfigError>("positional encoding: num_octaves: expected 0 or more, found {}", num_octaves);
  if (output_dim() == 0) Throw<ConfigError>("positional encoding: expected an octave or the identity, found neither");
}

torch::Tensor PositionalEncoding::forward(const torch::Tensor& x, std::optional<double> window_alpha) const {
  CheckLastDim(x, dim_, "x");
  if (num_octaves_ == 0) return x;
  if (const std::vector<float> weights = WindowWeights(window_alpha, num_octaves_); CanEncodeSinusoids(x, weights)) {
    if (InOnePeriod(x)) return EncodeSinusoids(x, weights, include_identity_);
  }
  const torch::TensorOptions options = x.options().requires_grad(false);
  const torch::Tensor phase = WithinOnePeriod(x).unsqueeze(-2) * Frequencies(num_octaves_, options).unsqueeze(-1);
  torch::Tensor waves = torch::stack({phase.sin(), phase.cos()}, -2);  // [..., K, 2, dim]
  if (window_alpha && *window_alpha < static_cast<double>(num_octaves_)) {
    waves = waves * EncodingWindow(*window_alpha, num_octaves_, options).view({num_octaves_, 1, 1});
  }
  waves = waves.flatten(-3);
  return include_identity_ ? torch::cat({x, waves}, -1) : waves;
}

torch::Tensor EncodingWindow(double alpha, int64_t num_octaves, const torch::TensorOptions& options) {
  const torch::Tensor open = (alpha - torch::arange(num_octaves, options)).clamp(0.0, 1.0);
  return 0.5 * (1 - (kPi * open).cos());
}

double WindowAlpha(int64_t step, int64_t delay, int64_t steps, int64_t num_octaves) {
  const double open = static_cast<double>(num_octaves);
  if (step < delay) return 0;
  if (steps <= 0) return open;
  return open * std::clamp(static_cast<double>(step - delay) / static_cast<double>(steps), 0.0, 1.0);
}

}  // namespace editnerf
