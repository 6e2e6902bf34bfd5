// From a network's density output to a density.
#pragma once

#include <torch/types.h>

namespace editnerf {

// softplus(y) = log(1 + exp(y)) >= 0, of any shape: finite, with a gradient in [0, 1], for every finite y (checked to
// +-1e4). Exact to rounding: LibTorch's default switches to the identity at 20, an error of 2e-9.
torch::Tensor DensityFromPreactivation(const torch::Tensor& y);

}  // namespace editnerf
