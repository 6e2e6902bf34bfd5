#include "libeditnerf/field/mlp.h"

#include <torch/nn/init.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

torch::nn::Linear MakeLinear(int64_t in, int64_t out, const LayerInit& init) {
  torch::nn::Linear layer(in, out);
  const torch::NoGradGuard no_grad;
  switch (init.kind) {
    case LayerInit::Kind::kGlorotUniform:
      torch::nn::init::xavier_uniform_(layer->weight);
      break;
    case LayerInit::Kind::kNormal:
      layer->weight.normal_(0, init.scale);
      break;
    case LayerInit::Kind::kUniform:
      layer->weight.uniform_(0, init.scale);
      break;
  }
  layer->bias.zero_();
  return layer;
}

MlpImpl::MlpImpl(const MlpOptions& options) : options_(options) {
  if (options.in < 1) Throw<ConfigError>("mlp: in: expected 1 or more, found {}", options.in);
  if (options.depth < 1) Throw<ConfigError>("mlp: depth: expected 1 or more, found {}", options.depth);
  if (options.width < 1) Throw<ConfigError>("mlp: width: expected 1 or more, found {}", options.width);
  int64_t in = options.in;
  for (int64_t i = 0; i < options.depth; ++i) {
    if (i > 0 && i == options.skip_layer) in += options.in;
    hidden_.push_back(
        register_module("hidden" + std::to_string(i), MakeLinear(in, options.width, LayerInit::GlorotUniform())));
    in = options.width;
  }
  if (options.out > 0) output_ = register_module("output", MakeLinear(in, options.out, options.output_init));
}

MlpLayers MlpImpl::Layers() const {
  MlpLayers layers;
  for (const auto& layer : hidden_) {
    layers.weights.push_back(layer->weight);
    layers.biases.push_back(layer->bias);
  }
  layers.linear_output = !output_.is_empty();
  if (layers.linear_output) {
    layers.weights.push_back(output_->weight);
    layers.biases.push_back(output_->bias);
  }
  return layers;
}

torch::Tensor MlpImpl::forward(const std::vector<torch::Tensor>& parts) {
  if (!has_skip()) {
    const MlpLayers layers = Layers();
    if (CanFuseMlp(parts, layers)) return FusedMlp(parts, layers);
  }
  return forward(parts.size() == 1 ? parts.front() : torch::cat(parts, -1));
}

torch::Tensor MlpImpl::forward(const torch::Tensor& x) {
  CheckLastDim(x, options_.in, "x");
  torch::Tensor y = x;
  for (size_t i = 0; i < hidden_.size(); ++i) {
    if (i > 0 && static_cast<int64_t>(i) == options_.skip_layer) y = torch::cat({y, x}, -1);
    y = hidden_[i]->forward(y).relu_();
  }
  return output_ ? output_->forward(y) : y;
}

}  // namespace editnerf
