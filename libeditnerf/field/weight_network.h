// Which key points govern a canonical point, and by how much.
//
// EditableNeRF (Zheng et al., CVPR 2023), eq. (2):
//   w(x') = softmax(W(gamma(x')))        w^i > 0, sum_i w^i = 1
// With one key point the weights are identically 1: do not build this module. The output layer starts at nearly zero,
// so that training starts at equal weights; with a distance prior (ours, for the fast field) they start in favour of
// the key point whose initial track passes nearest:
//   w(x') = softmax(W(gamma(x')) - prior d(x') / spacing)   d^i: distance to some positions of track i
//                                                           spacing: median distance from one track to the others
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

class WeightNetworkImpl : public torch::nn::Module {
 public:
  // num_key_points N >= 2; throws ConfigError.
  // initial_tracks [T, N, 3], scene units, for the prior; undefined: to be loaded from a checkpoint.
  WeightNetworkImpl(const WeightNetworkConfig& config, int64_t num_key_points,
                    const torch::Tensor& initial_tracks = torch::Tensor());

  // x_canonical [..., 3], scene units -> weights [..., N]; same dtype and device. Throws ShapeError unless the last
  // dimension is 3.
  torch::Tensor forward(const torch::Tensor& x_canonical);

  // Fills in its part.
  void AddTo(FusedField* field) const;

 private:
  PositionalEncoding encoding_;
  Mlp mlp_;
  double prior_;
  torch::Tensor anchors_, spacing_;  // [N, kAnchors, 3] and []; undefined without a prior
};
TORCH_MODULE(WeightNetwork);

}  // namespace editnerf
