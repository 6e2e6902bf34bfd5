#include "libeditnerf/tracking/raft_flow.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>
#include <utility>

#include "libeditnerf/base/digest.h"
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

struct Encoded : OpticalFlow::Prepared {
  RaftFeatures features;
};

}  // namespace

RaftFlow::RaftFlow(Raft network, const RaftFlowOptions& options) : network_(std::move(network)), options_(options) {
  if (options.iterations < 1) Throw<ConfigError>("RAFT: found {} iterations, expected at least 1", options.iterations);
  if (options.enlarge < 1) Throw<ConfigError>("RAFT: found enlargement {}, expected at least 1", options.enlarge);
}

std::string RaftFlow::Name() const {
  return fmt::format("RAFT ({}), {} iterations{}", network_->shape().convex ? "large" : "small", options_.iterations,
                     options_.enlarge > 1 ? fmt::format(", images enlarged {} times", options_.enlarge) : "");
}

std::string RaftFlow::Identity() const {
  Digest digest;
  for (const torch::Tensor& parameter : network_->parameters()) digest.Add(parameter);
  for (const torch::Tensor& buffer : network_->buffers()) digest.Add(buffer);
  return Name() + ", weights " + digest.Text();
}

torch::Tensor RaftFlow::Flow(const torch::Tensor& from, const torch::Tensor& to) const {
  return FlowFrom(from, to, torch::Tensor());
}

torch::Tensor RaftFlow::FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const {
  CheckImages(from, to);
  return FlowBetween(*Prepare(from), *Prepare(to), guess);
}

std::shared_ptr<const OpticalFlow::Prepared> RaftFlow::Prepare(const torch::Tensor& image) const {
  CheckImages(image, image);
  const torch::NoGradGuard no_grad;
  auto encoded = std::make_shared<Encoded>();
  encoded->image = image;
  encoded->features = network_->Encode(Input(image, options_.enlarge));
  return encoded;
}

torch::Tensor RaftFlow::FlowBetween(const Prepared& from, const Prepared& to, const torch::Tensor& guess) const {
  const torch::NoGradGuard no_grad;
  CheckImages(from.image, to.image);
  torch::Tensor initial;
  if (guess.defined()) {
    CheckGuess(from.image, guess);
    initial = Initial(guess, options_.enlarge);
  }
  torch::Tensor flow = network_->Flow(dynamic_cast<const Encoded&>(from).features,
                                      dynamic_cast<const Encoded&>(to).features, options_.iterations, initial);
  const int64_t height = options_.enlarge * from.image.size(0), width = options_.enlarge * from.image.size(1);
  const auto margins = Margins(height, width);
  flow = flow.slice(2, margins[2], margins[2] + height).slice(3, margins[0], margins[0] + width);
  if (options_.enlarge > 1) flow = torch::avg_pool2d(flow.contiguous(), options_.enlarge) / options_.enlarge;
  return flow[0].permute({1, 2, 0}).contiguous();
}

}  // namespace editnerf
