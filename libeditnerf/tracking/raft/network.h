// RAFT, small and large (Teed & Deng, "RAFT: Recurrent All-Pairs Field Transforms for Optical Flow", ECCV 2020).
//
//   features f, g of both images, context of the first, all at 1/8 of the size
//   x = p + initial flow; repeat: state = update(state, context, correlation around x, x - p); x += change(state)
//   flow = 8 (x - p), enlarged 8 times: bilinear (small) or by learned convex weights of 3 x 3 places (large)
// Parameters are named as in the authors' published weights (weights.h reads them). Inference on the CPU in float32:
// the correlation's look-up has no gradient.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/tracking/raft/encoder.h"
#include "libeditnerf/tracking/raft/update.h"

namespace editnerf {

// What one image contributes, the same for every pair in which it stands.
struct RaftFeatures {
  torch::Tensor features;  // [B, features, H / 8, W / 8]
  torch::Tensor state;     // [B, hidden, H / 8, W / 8], as first image of a pair
  torch::Tensor context;   // [B, context, H / 8, W / 8], as first image of a pair
};

class RaftImpl : public torch::nn::Module {
 public:
  explicit RaftImpl(const RaftShape& shape);  // weights are arbitrary until loaded

  // images [B, 3, H, W] float32 in [-1, 1], H and W multiples of 8. Throws ShapeError.
  RaftFeatures Encode(const torch::Tensor& images);

  // Flow [B, 2, H, W], pixels, from the images of `from` to those of `to`, after `iterations` >= 1 updates.
  // initial [B, 2, H / 8, W / 8], in units of 8 pixels: what to begin from; undefined for 0.
  torch::Tensor Flow(const RaftFeatures& from, const RaftFeatures& to, int64_t iterations,
                     const torch::Tensor& initial = torch::Tensor());

  torch::Tensor forward(const torch::Tensor& from, const torch::Tensor& to, int64_t iterations) {
    return Flow(Encode(from), Encode(to), iterations);
  }

  const RaftShape& shape() const { return shape_; }

 private:
  RaftShape shape_;
  RaftEncoder feature_encoder_ = nullptr, context_encoder_ = nullptr;  // "fnet", "cnet"
  RaftUpdate update_ = nullptr;                                        // "update_block"
};
TORCH_MODULE(Raft);

}  // namespace editnerf
