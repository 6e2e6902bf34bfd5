#include "libeditnerf/field/slicing_network.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

SlicingNetworkImpl::SlicingNetworkImpl(const SlicingNetworkConfig& config, int64_t code_dim)
    : code_dim_(code_dim), encoding_(3, config.num_octaves), mlp_(nullptr) {
  if (code_dim < 1) Throw<ConfigError>("slicing network: code_dim: expected 1 or more, found {}", code_dim);
  if (config.ambient_dim < 0) {
    Throw<ConfigError>("slicing network: ambient_dim: expected 0 or more, found {}", config.ambient_dim);
  }
  MlpOptions options;
  options.in = encoding_.output_dim() + code_dim;
  options.depth = config.depth;
  options.width = config.width;
  options.skip_layer = config.skip_layer;
  options.out = config.AmbientDim();
  options.output_init = LayerInit::Normal(config.output_init);
  mlp_ = register_module("mlp", Mlp(options));
}

torch::Tensor SlicingNetworkImpl::forward(const torch::Tensor& x_observed, const torch::Tensor& warp_code) {
  CheckShape(x_observed, {kAny, 3}, "x_observed");
  CheckShape(warp_code, {x_observed.size(0), code_dim_}, "warp_code");
  return mlp_->forward(std::vector<torch::Tensor>{encoding_.forward(x_observed), warp_code});
}

bool SlicingNetworkImpl::AddTo(FusedField* field) const {
  if (mlp_->has_skip()) return false;
  field->slicing = mlp_->Layers();
  field->slicing_octaves = encoding_.num_octaves();
  field->code_dim = code_dim_;
  return true;
}

}  // namespace editnerf
