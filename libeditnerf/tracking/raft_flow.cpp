#include "libeditnerf/tracking/raft_flow.h"

#include <torch/torch.h>

#include <algorithm>
#include <array>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kScale = 8;

// Left, right, top, bottom.
std::array<int64_t, 4> Margins(int64_t height, int64_t width) {
  const int64_t more_width = (kScale - width % kScale) % kScale, more_height = (kScale - height % kScale) % kScale;
  return {more_width / 2, more_width - more_width / 2, more_height / 2, more_height - more_height / 2};
}

torch::Tensor Pad(const torch::Tensor& map, const std::array<int64_t, 4>& margins) {
  return torch::replication_pad2d(map, {margins[0], margins[1], margins[2], margins[3]});
}

// [H, W, 3] uint8 -> [1, 3, H', W'] in [-1, 1]
torch::Tensor Input(const torch::Tensor& image, int64_t enlarge) {
  torch::Tensor input = image.permute({2, 0, 1}).unsqueeze(0).to(torch::kFloat32).contiguous();
  if (enlarge > 1) {
    input = torch::upsample_bicubic2d(input, {enlarge * image.size(0), enlarge * image.size(1)},
                                      /*align_corners=*/false)
                .clamp(0, 255);
  }
  return Pad(input / 127.5 - 1, Margins(input.size(2), input.size(3)));
}

// [H, W, 2] pixels -> [1, 2, H'/8, W'/8] in units of 8 enlarged pixels
torch::Tensor Initial(const torch::Tensor& guess, int64_t enlarge) {
  torch::Tensor flow = guess.to(torch::kFloat32).nan_to_num(0.0).permute({2, 0, 1}).unsqueeze(0).contiguous();
  if (enlarge > 1) {
    flow = torch::upsample_nearest2d(flow, {enlarge * guess.size(0), enlarge * guess.size(1)});
  }
  flow = Pad(flow, Margins(flow.size(2), flow.size(3)));
  return torch::avg_pool2d(flow, kScale) * (static_cast<double>(enlarge) / kScale);
}

void CheckImages(const torch::Tensor& from, const torch::Tensor& to) {
  constexpr int64_t kSmallestSide = 16;
  CheckShape(from, {kAny, kAny, 3}, "first image");
  CheckShape(to, {from.size(0), from.size(1), 3}, "second image");
  if (from.scalar_type() != torch::kUInt8 || to.scalar_type() != torch::kUInt8) {
    Throw<ShapeError>("optical flow: expected uint8 images, found {} and {}", c10::toString(from.scalar_type()),
                      c10::toString(to.scalar_type()));
  }
  if (std::min(from.size(0), from.size(1)) < kSmallestSide) {
    Throw<DataError>("optical flow: found images of {} x {} pixels, expected at least {} a side", from.size(1),
                     from.size(0), kSmallestSide);
  }
}

}  // namespace

RaftFlow::RaftFlow(Raft network, const RaftFlowOptions& options) : network_(std::move(network)), options_(options) {
  if (options.iterations < 1) Throw<ConfigError>("RAFT: found {} iterations, expected at least 1", options.iterations);
  if (options.enlarge < 1) Throw<ConfigError>("RAFT: found enlargement {}, expected at least 1", options.enlarge);
}

torch::Tensor RaftFlow::Flow(const torch::Tensor& from, const torch::Tensor& to) const {
  return FlowFrom(from, to, torch::Tensor());
}

torch::Tensor RaftFlow::FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const {
  const torch::NoGradGuard no_grad;
  CheckImages(from, to);
  torch::Tensor initial;
  if (guess.defined()) {
    CheckGuess(from, guess);
    initial = Initial(guess, options_.enlarge);
  }
  const torch::Tensor both = torch::cat({Input(from, options_.enlarge), Input(to, options_.enlarge)});
  const RaftFeatures features = network_->Encode(both);
  const auto part = [&](int64_t i) {
    const auto row = [i](const torch::Tensor& x) { return x.slice(0, i, i + 1); };
    return RaftFeatures{row(features.features), row(features.state), row(features.context)};
  };
  torch::Tensor flow = network_->Flow(part(0), part(1), options_.iterations, initial);
  const int64_t height = options_.enlarge * from.size(0), width = options_.enlarge * from.size(1);
  const auto margins = Margins(height, width);
  flow = flow.slice(2, margins[2], margins[2] + height).slice(3, margins[0], margins[0] + width);
  if (options_.enlarge > 1) flow = torch::avg_pool2d(flow.contiguous(), options_.enlarge) / options_.enlarge;
  return flow[0].permute({1, 2, 0}).contiguous();
}

}  // namespace editnerf
