#include "libeditnerf/tracking/raft/encoder.h"

#include <torch/nn/modules/batchnorm.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/modules/conv.h>
#include <torch/types.h>

namespace editnerf {
namespace {

constexpr double kNormEpsilon = 1e-5;

torch::Tensor InstanceNorm(const torch::Tensor& x) {
  return torch::instance_norm(x, {}, {}, {}, {}, /*use_input_stats=*/true, 0.1, kNormEpsilon, /*cudnn_enabled=*/true);
}

torch::nn::Conv2d Convolution(int64_t in, int64_t out, int64_t kernel, int64_t stride) {
  return torch::nn::Conv2d(torch::nn::Conv2dOptions(in, out, kernel).stride(stride).padding(kernel / 2));
}

}  // namespace

size_t RaftConvolutions::Add(const std::string& suffix, int64_t in, int64_t out, int64_t kernel, int64_t stride,
                             RaftNorm norm) {
  Layer layer;
  layer.convolution = register_module("conv" + suffix, Convolution(in, out, kernel, stride));
  layer.norm = norm;
  if (norm == RaftNorm::kBatch) {
    layer.batch_norm = register_module("norm" + suffix, torch::nn::BatchNorm2d(out));
  }
  layers_.push_back(layer);
  return layers_.size() - 1;
}

torch::Tensor RaftConvolutions::Apply(size_t index, const torch::Tensor& x) {
  Layer& layer = layers_[index];
  torch::Tensor y = layer.convolution->forward(x);
  if (layer.norm == RaftNorm::kInstance) y = InstanceNorm(y);
  if (layer.norm == RaftNorm::kBatch) y = layer.batch_norm->forward(y);
  return y;
}

RaftBlockImpl::RaftBlockImpl(int64_t in, int64_t out, int64_t stride, const RaftEncoderOptions& options)
    : norm_(options.norm) {
  if (options.bottleneck) {
    const int64_t inner = out / 4;
    Add("1", in, inner, 1, 1, norm_);
    Add("2", inner, inner, 3, stride, norm_);
    num_layers_ = Add("3", inner, out, 1, 1, norm_) + 1;
  } else {
    Add("1", in, out, 3, stride, norm_);
    num_layers_ = Add("2", out, out, 3, 1, norm_) + 1;
  }
  if (stride == 1 && in == out) return;
  downsample_ = register_module("downsample", torch::nn::Sequential(Convolution(in, out, 1, stride)));
  if (norm_ == RaftNorm::kBatch) downsample_->push_back(torch::nn::BatchNorm2d(out));
}

torch::Tensor RaftBlockImpl::forward(const torch::Tensor& x) {
  torch::Tensor y = x;
  for (size_t i = 0; i < num_layers_; ++i) y = Apply(i, y).relu_();
  torch::Tensor shortcut = x;
  if (downsample_) {
    shortcut = downsample_->forward(x);
    if (norm_ == RaftNorm::kInstance) shortcut = InstanceNorm(shortcut);
  }
  return torch::relu(shortcut + y);
}

RaftEncoderImpl::RaftEncoderImpl(const RaftEncoderOptions& options) {
  Add("1", 3, options.widths[0], 7, 2, options.norm);
  int64_t in = options.widths[0];
  for (size_t i = 0; i < stages_.size(); ++i) {
    const int64_t out = options.widths[i];
    stages_[i] = register_module(
        "layer" + std::to_string(i + 1),
        torch::nn::Sequential(RaftBlock(in, out, i == 0 ? 1 : 2, options), RaftBlock(out, out, 1, options)));
    in = out;
  }
  Add("2", in, options.out, 1, 1, RaftNorm::kNone);
}

torch::Tensor RaftEncoderImpl::forward(const torch::Tensor& images) {
  torch::Tensor x = Apply(0, images).relu_();
  for (auto& stage : stages_) x = stage->forward(x);
  return Apply(1, x);
}

}  // namespace editnerf
