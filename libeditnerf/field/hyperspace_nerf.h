// The paper's network over hyperspace.
//
// EditableNeRF (Zheng et al., CVPR 2023), eq. (4), with HyperNeRF's architecture:
//   h = trunk(gamma(x'), gamma_a(a)),  sigma = softplus(linear(h)),  c = sigmoid(colour(linear(h), gamma(d), alpha_t))
// gamma_a has no identity and opens with a window, so that the ambient coordinates come in late. Where the colour
// depends on neither d nor alpha_t, the linear bottleneck in front of the colour layer is not built.
#pragma once

#include <torch/nn/modules/linear.h>
#include <torch/nn/pimpl.h>

#include <cstdint>
#include <optional>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/field/hyperspace_network.h"
#include "libeditnerf/field/mlp.h"
#include "libeditnerf/field/positional_encoding.h"

namespace editnerf {

// What the network is fed with, beside x'.
struct HyperspaceInputs {
  int64_t ambient_dim = 3;                   // A; 0: a static scene
  std::optional<int64_t> direction_octaves;  // of gamma(d), beside the identity; absent: no view direction
  int64_t appearance_dim = 0;                // Da; 0: no appearance code
};

class HyperspaceNerfImpl : public HyperspaceNetwork {
 public:
  HyperspaceNerfImpl(const HyperspaceNerfConfig& config, const HyperspaceInputs& inputs);  // throws ConfigError

  // HyperspaceNetwork. `local` and `weights` are not read; neither are inputs that the network was not built for.
  HyperspaceOutput Evaluate(const HyperspaceInput& input) override;
  torch::Tensor Density(const HyperspaceInput& input) override;

  // The ambient window is open until the first call.
  void SetStep(int64_t step) override;

 private:
  torch::Tensor Trunk(const HyperspaceInput& input);
  torch::Tensor DensityOf(const torch::Tensor& features);

  HyperspaceNerfConfig config_;
  HyperspaceInputs inputs_;
  std::optional<double> ambient_alpha_;
  PositionalEncoding encoding_;
  std::optional<PositionalEncoding> ambient_encoding_;
  std::optional<PositionalEncoding> direction_encoding_;
  Mlp trunk_ = nullptr;
  torch::nn::Linear density_ = nullptr;
  torch::nn::Linear bottleneck_ = nullptr;
  Mlp color_ = nullptr;
};
TORCH_MODULE(HyperspaceNerf);

}  // namespace editnerf
