#include "libeditnerf/tracking/raft/network.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/raft/correlation.h"

namespace editnerf {
namespace {

constexpr int64_t kScale = 8;

// [B, 2, H, W], place centres at whole numbers, (x, y).
torch::Tensor Places(const torch::Tensor& like) {
  const int64_t height = like.size(2), width = like.size(3);
  const torch::Tensor x = torch::arange(width, like.options()).view({1, width}).expand({height, width});
  const torch::Tensor y = torch::arange(height, like.options()).view({height, 1}).expand({height, width});
  return torch::stack({x, y}).unsqueeze(0).expand({like.size(0), 2, height, width}).contiguous();
}

torch::Tensor EnlargeBilinear(const torch::Tensor& flow) {
  return kScale * torch::upsample_bilinear2d(flow, {kScale * flow.size(2), kScale * flow.size(3)},
                                             /*align_corners=*/true);
}

// Each of the 8 x 8 pixels of a place is a convex combination of the flow at 3 x 3 places.
torch::Tensor EnlargeConvex(const torch::Tensor& flow, const torch::Tensor& logits) {
  const int64_t batch = flow.size(0), height = flow.size(2), width = flow.size(3);
  const torch::Tensor weights = torch::softmax(logits.view({batch, 1, 9, kScale, kScale, height, width}), 2);
  const torch::Tensor neighbours =
      torch::im2col(kScale * flow, {3, 3}, {1, 1}, {1, 1}, {1, 1}).view({batch, 2, 9, 1, 1, height, width});
  return (weights * neighbours)
      .sum(2)  // [B, 2, 8, 8, H, W]
      .permute({0, 1, 4, 2, 5, 3})
      .reshape({batch, 2, kScale * height, kScale * width});
}

RaftEncoderOptions EncoderOptions(const RaftShape& shape, int64_t out, RaftNorm norm) {
  RaftEncoderOptions options;
  options.bottleneck = shape.bottleneck;
  options.widths = shape.widths;
  options.out = out;
  options.norm = norm;
  return options;
}

}  // namespace

RaftImpl::RaftImpl(const RaftShape& shape) : shape_(shape) {
  feature_encoder_ = register_module("fnet", RaftEncoder(EncoderOptions(shape, shape.features, RaftNorm::kInstance)));
  context_encoder_ =
      register_module("cnet", RaftEncoder(EncoderOptions(shape, shape.hidden + shape.context,
                                                         shape.bottleneck ? RaftNorm::kNone : RaftNorm::kBatch)));
  update_ = register_module("update_block", RaftUpdate(shape));
}

RaftFeatures RaftImpl::Encode(const torch::Tensor& images) {
  CheckShape(images, {kAny, 3, kAny, kAny}, "images");
  if (images.size(2) % kScale != 0 || images.size(3) % kScale != 0) {
    Throw<ShapeError>("RAFT: found images of {} x {} pixels, expected multiples of {}", images.size(3), images.size(2),
                      kScale);
  }
  RaftFeatures encoded;
  encoded.features = feature_encoder_->forward(images);
  const torch::Tensor context = context_encoder_->forward(images);
  encoded.state = torch::tanh(context.slice(1, 0, shape_.hidden));
  encoded.context = torch::relu(context.slice(1, shape_.hidden));
  return encoded;
}

torch::Tensor RaftImpl::Flow(const RaftFeatures& from, const RaftFeatures& to, int64_t iterations,
                             const torch::Tensor& initial) {
  if (iterations < 1) Throw<ConfigError>("RAFT: found {} iterations, expected at least 1", iterations);
  const RaftCorrelation correlation(from.features, to.features, shape_.radius);
  const torch::Tensor start = Places(from.features);
  torch::Tensor places = start.clone(), state = from.state;
  if (initial.defined()) {
    CheckShape(initial, {start.size(0), 2, start.size(2), start.size(3)}, "initial flow");
    places = places + initial;
  }
  for (int64_t i = 0; i < iterations; ++i) {
    state = update_->forward(state, from.context, correlation.Lookup(places), places - start);
    places = places + update_->FlowChange(state);
  }
  const torch::Tensor logits = update_->ConvexLogits(state);
  return logits.defined() ? EnlargeConvex(places - start, logits) : EnlargeBilinear(places - start);
}

}  // namespace editnerf
