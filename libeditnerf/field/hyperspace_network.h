// What a field asks of the network over hyperspace, whatever it is made of.
//
//   (c, sigma) = H(x' (+) a, d, alpha_t)       EditableNeRF (Zheng et al., CVPR 2023), eq. (4)
//
// a is the slice of the pretrained HyperNeRF or the weighted key point p in local coordinates. Implementations: the
// paper's multi-layer perceptrons (hyperspace_nerf.h) and the fast field over two hash encodings.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <cstdint>

namespace editnerf {

// S samples. Floating-point tensors share one dtype and device; tensors that a network has no use for are undefined.
struct HyperspaceInput {
  torch::Tensor x_canonical;  // [S, 3], scene units
  torch::Tensor ambient;      // [S, A]: a in pretraining, p in local coordinates in training
  torch::Tensor local;        // [S, 3], scene units: x' - p, or turned into local frames; undefined in pretraining
  torch::Tensor weights;      // [S, N]: of the key points; undefined for N = 1 and in pretraining
  torch::Tensor from_keys;    // [S, N, 3], scene units: x' - k_i, no gradient; undefined without shade, and for Density
  torch::Tensor direction;    // [S, 3], unit length; undefined where the colour does not depend on it, and for Density
  torch::Tensor appearance;   // [S, Da]; undefined where the colour does not depend on it, and for Density
};

struct HyperspaceOutput {
  torch::Tensor density;   // [S], per scene unit, >= 0
  torch::Tensor radiance;  // [S, 3], in [0, 1]
};

class HyperspaceNetwork : public torch::nn::Module {
 public:
  using torch::nn::Module::Module;

  // Throws ShapeError unless the shapes are those of HyperspaceInput.
  virtual HyperspaceOutput Evaluate(const HyperspaceInput& input) = 0;

  // The density alone, [S]; `input.direction` and `input.appearance` are not read.
  virtual torch::Tensor Density(const HyperspaceInput& input) = 0;

  // Coarse-to-fine windows are functions of the optimisation step.
  virtual void SetStep(int64_t step) = 0;
};

}  // namespace editnerf
