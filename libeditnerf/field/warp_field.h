// From observed to canonical points: one rigid motion per point and frame code.
//
// EditableNeRF (Zheng et al., CVPR 2023), eq. (1), with the SE(3) field of Nerfies (Park et al., ICCV 2021):
//   (w, v) = heads(MLP(gamma(x), beta_t)),   x' = T(x, beta_t) = exp(w, v) x
// Both heads start as U(0, head_init), so that training starts at nearly the identity; gradients are exact there
// (se3.h).
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/linear.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/field/mlp.h"
#include "libeditnerf/field/positional_encoding.h"

namespace editnerf {

class WarpFieldImpl : public torch::nn::Module {
 public:
  explicit WarpFieldImpl(const WarpFieldConfig& config);  // throws ConfigError

  // x_observed [S, 3], scene units; warp_code [S, code_dim]; window_alpha of gamma (WindowAlpha of the step), open when
  // absent -> x_canonical [S, 3], scene units. Throws ShapeError.
  torch::Tensor forward(const torch::Tensor& x_observed, const torch::Tensor& warp_code,
                        std::optional<double> window_alpha = std::nullopt);

 private:
  int64_t code_dim_;
  PositionalEncoding encoding_;
  Mlp trunk_;
  torch::nn::Linear rotation_ = nullptr;     // w, radians
  torch::nn::Linear translation_ = nullptr;  // v, scene units
};
TORCH_MODULE(WarpField);

}  // namespace editnerf
