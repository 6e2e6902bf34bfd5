#include "libeditnerf/field/warp_field.h"

#include "libeditnerf/base/shape.h"
#include "libeditnerf/geometry/se3.h"

namespace editnerf {

WarpFieldImpl::WarpFieldImpl(const WarpFieldConfig& config)
    : code_dim_(config.code_dim), encoding_(3, config.num_octaves), trunk_(nullptr) {
  MlpOptions trunk;
  trunk.in = encoding_.output_dim() + config.code_dim;
  trunk.depth = config.depth;
  trunk.width = config.width;
  trunk.skip_layer = config.skip_layer;
  trunk_ = register_module("trunk", Mlp(trunk));
  rotation_ = register_module("rotation", MakeLinear(config.width, 3, LayerInit::Uniform(config.head_init)));
  translation_ = register_module("translation", MakeLinear(config.width, 3, LayerInit::Uniform(config.head_init)));
}

torch::Tensor WarpFieldImpl::forward(const torch::Tensor& x_observed, const torch::Tensor& warp_code,
                                     std::optional<double> window_alpha) {
  CheckShape(x_observed, {kAny, 3}, "x_observed");
  CheckShape(warp_code, {x_observed.size(0), code_dim_}, "warp_code");
  const torch::Tensor features =
      trunk_->forward(std::vector<torch::Tensor>{encoding_.forward(x_observed, window_alpha), warp_code});
  return ExpSe3(rotation_->forward(features), translation_->forward(features), x_observed);
}

}  // namespace editnerf
