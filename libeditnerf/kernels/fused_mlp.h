// A small multi-layer perceptron in one pass over tiles of samples: the activations never leave the first-level caches,
// and the backward pass computes them again instead of storing them (docs/benchmarks/README.md).
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

namespace editnerf {

// relu after every layer but, where `linear_output`, the last:  y = W_l h + b_l,  h = [inputs[0], inputs[1], ...].
struct MlpLayers {
  std::vector<at::Tensor> weights;  // [out, in], as in torch::nn::Linear
  std::vector<at::Tensor> biases;   // [out]
  bool linear_output = true;
};

// Whether FusedMlp takes these: float32 on the CPU, all of them, and inputs [S, F_i].
bool CanFuseMlp(const std::vector<at::Tensor>& inputs, const MlpLayers& layers);

// inputs [S, F_i], together as wide as the first layer's input -> [S, out]. Differentiable once in everything.
// Throws ShapeError where widths do not fit together.
at::Tensor FusedMlp(const std::vector<at::Tensor>& inputs, const MlpLayers& layers);

// The same in plain LibTorch operations: what FusedMlp is tested against, and what runs elsewhere.
at::Tensor MlpReference(const std::vector<at::Tensor>& inputs, const MlpLayers& layers);

}  // namespace editnerf
