#include "libeditnerf/tracking/raft/update.h"

#include <torch/nn/modules/activation.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/modules/conv.h>
#include <torch/types.h>

#include <string>

#include "libeditnerf/tracking/raft/correlation.h"

namespace editnerf {
namespace {

torch::nn::Conv2d Convolution(int64_t in, int64_t out, int64_t height, int64_t width) {
  return torch::nn::Conv2d(torch::nn::Conv2dOptions(in, out, {height, width}).padding({height / 2, width / 2}));
}

}  // namespace

const RaftShape& RaftShape::Small() {
  static const RaftShape shape = {true, {32, 64, 96}, 128, 96, 64, 3, {96}, {64, 32}, 82, 128, false, false};
  return shape;
}

const RaftShape& RaftShape::Large() {
  static const RaftShape shape = {false, {64, 96, 128}, 256, 128, 128, 4, {256, 192}, {128, 64}, 128, 256, true, true};
  return shape;
}

RaftMotionEncoderImpl::RaftMotionEncoderImpl(const RaftShape& shape) {
  int64_t in = RaftCorrelation::kLevels * (2 * shape.radius + 1) * (2 * shape.radius + 1);
  for (size_t i = 0; i < shape.correlation.size(); ++i) {
    const int64_t kernel = i == 0 ? 1 : 3;
    correlation_.push_back(
        register_module("convc" + std::to_string(i + 1), Convolution(in, shape.correlation[i], kernel, kernel)));
    in = shape.correlation[i];
  }
  flow1_ = register_module("convf1", Convolution(2, shape.flow[0], 7, 7));
  flow2_ = register_module("convf2", Convolution(shape.flow[0], shape.flow[1], 3, 3));
  joint_ = register_module("conv", Convolution(in + shape.flow[1], shape.motion - 2, 3, 3));
}

torch::Tensor RaftMotionEncoderImpl::forward(const torch::Tensor& correlation, const torch::Tensor& flow) {
  torch::Tensor c = correlation;
  for (auto& layer : correlation_) c = layer->forward(c).relu_();
  const torch::Tensor f = flow2_->forward(flow1_->forward(flow).relu_()).relu_();
  return torch::cat({joint_->forward(torch::cat({c, f}, 1)).relu_(), flow}, 1);
}

RaftGruImpl::RaftGruImpl(int64_t hidden, int64_t in, bool separable) {
  for (int64_t pass = 1; pass <= (separable ? 2 : 1); ++pass) {
    const int64_t height = separable ? (pass == 1 ? 1 : 5) : 3, width = separable ? (pass == 1 ? 5 : 1) : 3;
    const auto layer = [&](const std::string& name) {
      return register_module(name + std::to_string(pass), Convolution(hidden + in, hidden, height, width));
    };
    Pass convolutions;
    convolutions.z = layer("convz");
    convolutions.r = layer("convr");
    convolutions.q = layer("convq");
    passes_.push_back(convolutions);
  }
}

torch::Tensor RaftGruImpl::forward(const torch::Tensor& state, const torch::Tensor& input) {
  torch::Tensor h = state;
  for (Pass& pass : passes_) {
    const torch::Tensor both = torch::cat({h, input}, 1);
    const torch::Tensor z = pass.z->forward(both).sigmoid_(), r = pass.r->forward(both).sigmoid_();
    const torch::Tensor q = pass.q->forward(torch::cat({r * h, input}, 1)).tanh_();
    h = (1 - z) * h + z * q;
  }
  return h;
}

RaftFlowHeadImpl::RaftFlowHeadImpl(int64_t hidden, int64_t inner) {
  first_ = register_module("conv1", Convolution(hidden, inner, 3, 3));
  second_ = register_module("conv2", Convolution(inner, 2, 3, 3));
}

torch::Tensor RaftFlowHeadImpl::forward(const torch::Tensor& state) {
  return second_->forward(first_->forward(state).relu_());
}

RaftUpdateImpl::RaftUpdateImpl(const RaftShape& shape) {
  encoder_ = register_module("encoder", RaftMotionEncoder(shape));
  gru_ = register_module("gru", RaftGru(shape.hidden, shape.context + shape.motion, shape.separable));
  flow_head_ = register_module("flow_head", RaftFlowHead(shape.hidden, shape.flow_head));
  if (!shape.convex) return;
  mask_ = register_module("mask", torch::nn::Sequential(Convolution(shape.hidden, 256, 3, 3), torch::nn::ReLU(),
                                                        Convolution(256, 9 * 64, 1, 1)));
}

torch::Tensor RaftUpdateImpl::forward(const torch::Tensor& state, const torch::Tensor& context,
                                      const torch::Tensor& correlation, const torch::Tensor& flow) {
  return gru_->forward(state, torch::cat({context, encoder_->forward(correlation, flow)}, 1));
}

torch::Tensor RaftUpdateImpl::FlowChange(const torch::Tensor& state) { return flow_head_->forward(state); }

torch::Tensor RaftUpdateImpl::ConvexLogits(const torch::Tensor& state) {
  // The authors train with a quarter of the gradient here, which is part of the network's values too.
  return mask_ ? 0.25 * mask_->forward(state) : torch::Tensor();
}

}  // namespace editnerf
