#include "libeditnerf/field/weight_network.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

WeightNetworkImpl::WeightNetworkImpl(const WeightNetworkConfig& config, int64_t num_key_points)
    : encoding_(3, config.num_octaves), mlp_(nullptr) {
  if (num_key_points < 2) {
    Throw<ConfigError>("weight network: num_key_points: expected 2 or more, found {}", num_key_points);
  }
  MlpOptions options;
  options.in = encoding_.output_dim();
  options.depth = config.depth;
  options.width = config.width;
  options.out = num_key_points;
  options.output_init = LayerInit::Normal(config.output_init);
  mlp_ = register_module("mlp", Mlp(options));
}

torch::Tensor WeightNetworkImpl::forward(const torch::Tensor& x_canonical) {
  CheckLastDim(x_canonical, 3, "x_canonical");
  return torch::softmax(mlp_->forward(std::vector<torch::Tensor>{encoding_.forward(x_canonical)}), -1);
}

}  // namespace editnerf
