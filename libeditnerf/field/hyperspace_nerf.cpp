#include "libeditnerf/field/hyperspace_nerf.h"

#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/field/density_activation.h"

namespace editnerf {

HyperspaceNerfImpl::HyperspaceNerfImpl(const HyperspaceNerfConfig& config, const HyperspaceInputs& inputs)
    : config_(config), inputs_(inputs), encoding_(3, config.num_octaves) {
  if (inputs.ambient_dim < 0 || inputs.appearance_dim < 0) {
    Throw<ConfigError>(
        "hyperspace network: expected dimensions of 0 or more, found ambient_dim {} and appearance_dim {}",
        inputs.ambient_dim, inputs.appearance_dim);
  }
  MlpOptions trunk;
  trunk.in = encoding_.output_dim();
  if (inputs.ambient_dim > 0) {
    ambient_encoding_.emplace(inputs.ambient_dim, config.ambient_octaves, /*include_identity=*/false);
    trunk.in += ambient_encoding_->output_dim();
  }
  trunk.depth = config.depth;
  trunk.width = config.width;
  trunk.skip_layer = config.skip_layer;
  trunk_ = register_module("trunk", Mlp(trunk));
  density_ = register_module("density", MakeLinear(config.width, 1, LayerInit::GlorotUniform()));

  int64_t conditions = inputs.appearance_dim;
  if (inputs.direction_octaves) {
    direction_encoding_.emplace(3, *inputs.direction_octaves);
    conditions += direction_encoding_->output_dim();
  }
  if (conditions > 0) {
    bottleneck_ = register_module("bottleneck", MakeLinear(config.width, config.width, LayerInit::GlorotUniform()));
  }
  MlpOptions color;
  color.in = config.width + conditions;
  color.depth = 1;
  color.width = config.color_width;
  color.out = 3;
  color_ = register_module("color", Mlp(color));
}

void HyperspaceNerfImpl::SetStep(int64_t step) {
  ambient_alpha_ =
      WindowAlpha(step, config_.ambient_window_delay, config_.ambient_window_steps, config_.ambient_octaves);
}

torch::Tensor HyperspaceNerfImpl::Trunk(const HyperspaceInput& input) {
  CheckShape(input.x_canonical, {kAny, 3}, "x_canonical");
  const torch::Tensor encoded = encoding_.forward(input.x_canonical);
  if (!ambient_encoding_) return trunk_->forward(encoded);
  CheckShape(input.ambient, {input.x_canonical.size(0), inputs_.ambient_dim}, "ambient");
  return trunk_->forward(torch::cat({encoded, ambient_encoding_->forward(input.ambient, ambient_alpha_)}, -1));
}

torch::Tensor HyperspaceNerfImpl::DensityOf(const torch::Tensor& features) {
  return DensityFromPreactivation(density_->forward(features)).squeeze(-1);
}

torch::Tensor HyperspaceNerfImpl::Density(const HyperspaceInput& input) { return DensityOf(Trunk(input)); }

HyperspaceOutput HyperspaceNerfImpl::Evaluate(const HyperspaceInput& input) {
  const torch::Tensor features = Trunk(input);
  std::vector<torch::Tensor> color_input = {bottleneck_ ? bottleneck_->forward(features) : features};
  if (direction_encoding_) {
    CheckShape(input.direction, {features.size(0), 3}, "direction");
    color_input.push_back(direction_encoding_->forward(input.direction));
  }
  if (inputs_.appearance_dim > 0) {
    CheckShape(input.appearance, {features.size(0), inputs_.appearance_dim}, "appearance");
    color_input.push_back(input.appearance);
  }
  const torch::Tensor color = color_->forward(color_input.size() == 1 ? color_input[0] : torch::cat(color_input, -1));
  return {DensityOf(features), color.sigmoid()};
}

}  // namespace editnerf
