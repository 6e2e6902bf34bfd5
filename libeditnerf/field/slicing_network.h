// The ambient slice of the pretrained HyperNeRF: which shape of hyperspace a point of a frame shows.
//
// HyperNeRF (Park et al., SIGGRAPH Asia 2021), the deformable slicing surface:
//   a = S(x, beta_t) = MLP(gamma(x), beta_t)
// The output layer starts at nearly zero: training starts on one flat slice. The variance of a over the frames is what
// key points are detected from.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/field/mlp.h"
#include "libeditnerf/field/positional_encoding.h"
#include "libeditnerf/kernels/fused_field.h"

namespace editnerf {

class SlicingNetworkImpl : public torch::nn::Module {
 public:
  SlicingNetworkImpl(const SlicingNetworkConfig& config, int64_t code_dim);  // throws ConfigError

  // x_observed [S, 3], scene units; warp_code [S, code_dim] -> ambient [S, ambient_dim]. Throws ShapeError.
  torch::Tensor forward(const torch::Tensor& x_observed, const torch::Tensor& warp_code);

  // Fills in its part, or returns false: kernels know no networks with a skip.
  bool AddTo(FusedField* field) const;

 private:
  int64_t code_dim_;
  PositionalEncoding encoding_;
  Mlp mlp_;
};
TORCH_MODULE(SlicingNetwork);

}  // namespace editnerf
