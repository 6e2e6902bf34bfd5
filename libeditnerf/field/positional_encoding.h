// Sinusoidal positional encoding with a coarse-to-fine window.
//
// HyperNeRF (Park et al., SIGGRAPH Asia 2021), which EditableNeRF builds on, without a factor of pi:
//   gamma(x) = [x,] w_0 sin(x), w_0 cos(x), w_1 sin(2 x), w_1 cos(2 x), ..., w_{K-1} cos(2^{K-1} x)
//   w_k(alpha) = (1 - cos(pi clamp(alpha - k, 0, 1))) / 2
//
// Each sin and cos stands for the `dim` coordinates side by side. Without a window every w_k is 1; the identity is
// never windowed. Far-out coordinates are brought into one period first, so that every finite input has a finite
// encoding. What lies within one period in float32 on the CPU runs through kernels/sinusoids.h.
//
// Anchor: gamma(0) with one octave and identity is (0, 0, 1) in one dimension.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <optional>

namespace editnerf {

class PositionalEncoding {
 public:
  // dim >= 1, num_octaves K >= 0; throws ConfigError when nothing would come out.
  PositionalEncoding(int64_t dim, int64_t num_octaves, bool include_identity = true);

  // x [..., dim] -> [..., output_dim()], same dtype and device. Throws ShapeError.
  torch::Tensor forward(const torch::Tensor& x, std::optional<double> window_alpha = std::nullopt) const;

  int64_t output_dim() const { return dim_ * (2 * num_octaves_ + (include_identity_ ? 1 : 0)); }
  int64_t num_octaves() const { return num_octaves_; }

 private:
  int64_t dim_;
  int64_t num_octaves_;
  bool include_identity_;
};

// w_k(alpha) of the octaves k = 0 .. num_octaves-1, [num_octaves].
torch::Tensor EncodingWindow(double alpha, int64_t num_octaves, const torch::TensorOptions& options);

// The window's alpha at an optimisation step: 0 for `delay` steps, then linear to `num_octaves` (fully open) over
// `steps`; steps = 0 opens it at once after the delay.
double WindowAlpha(int64_t step, int64_t delay, int64_t steps, int64_t num_octaves);

}  // namespace editnerf
