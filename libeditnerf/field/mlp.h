// The multi-layer perceptron of the paper's networks: ReLU layers of one width, the input concatenated again before one
// of them, and an optional linear output layer. Biases start at zero.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/linear.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "libeditnerf/kernels/fused_mlp.h"

namespace editnerf {

// How a layer's weights start.
struct LayerInit {
  enum class Kind { kGlorotUniform, kNormal, kUniform };
  Kind kind = Kind::kGlorotUniform;
  double scale = 0;  // standard deviation of kNormal, upper end of kUniform

  static LayerInit GlorotUniform() { return {Kind::kGlorotUniform, 0}; }
  static LayerInit Normal(double standard_deviation) { return {Kind::kNormal, standard_deviation}; }
  static LayerInit Uniform(double high) { return {Kind::kUniform, high}; }  // U(0, high)
};

// A linear layer whose bias is zero and whose weights start as told.
torch::nn::Linear MakeLinear(int64_t in, int64_t out, const LayerInit& init);

struct MlpOptions {
  int64_t in = 0;          // no default is valid
  int64_t depth = 0;       // hidden layers, >= 1; no default is valid
  int64_t width = 0;       // neurons per hidden layer, >= 1; no default is valid
  int64_t skip_layer = 0;  // hidden layer, counted from 0, before which the input is concatenated again; 0: never
  int64_t out = 0;         // outputs of the linear output layer; 0: none, the last hidden layer is the output
  LayerInit output_init;   // hidden layers are always Glorot-uniform
};

class MlpImpl : public torch::nn::Module {
 public:
  explicit MlpImpl(const MlpOptions& options);  // throws ConfigError

  // x [..., in] -> [..., output_dim()]. Throws ShapeError.
  torch::Tensor forward(const torch::Tensor& x);

  // The same for an input that is given in parts [S, F_i], side by side. Without a skip layer, float32 on the CPU runs
  // in one fused pass (kernels/fused_mlp.h).
  torch::Tensor forward(const std::vector<torch::Tensor>& parts);

  int64_t output_dim() const { return options_.out > 0 ? options_.out : options_.width; }
  bool has_skip() const { return options_.skip_layer > 0 && options_.skip_layer < options_.depth; }
  MlpLayers Layers() const;  // of a network without skip

 private:
  MlpOptions options_;
  std::vector<torch::nn::Linear> hidden_;  // "hidden0", ...
  torch::nn::Linear output_ = nullptr;     // "output"
};
TORCH_MODULE(Mlp);

}  // namespace editnerf
