#include "libeditnerf/evaluation/lpips.h"

#include <torch/nn/modules/conv.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/pth_archive.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kSmallestSide = 17;

struct FireShape {
  int64_t index;  // in the published network
  int64_t in, squeeze, expand;
  bool pool_before;  // 3 x 3 maximum with stride 2
  bool is_feature;   // its output is compared
};
constexpr std::array<FireShape, 8> kFires = {{{3, 64, 16, 64, true, false},
                                              {4, 128, 16, 64, false, true},
                                              {6, 128, 32, 128, true, false},
                                              {7, 256, 32, 128, false, true},
                                              {9, 256, 48, 192, true, true},
                                              {10, 384, 48, 192, false, true},
                                              {11, 384, 64, 256, false, true},
                                              {12, 512, 64, 256, false, true}}};
constexpr int64_t kFirstChannels = 64;

// The authors scale colours in [-1, 1] by the mean and deviation of ImageNet, to these digits.
constexpr std::array<float, 3> kShift = {-0.030f, -0.088f, -0.188f};
constexpr std::array<float, 3> kScale = {0.458f, 0.448f, 0.450f};

torch::Tensor Column(const std::array<float, 3>& values) {
  return torch::tensor({values[0], values[1], values[2]}).view({3, 1, 1});
}

torch::nn::Conv2d Convolution(int64_t in, int64_t out, int64_t kernel, int64_t stride, int64_t padding) {
  return torch::nn::Conv2d(torch::nn::Conv2dOptions(in, out, kernel).stride(stride).padding(padding));
}

torch::Tensor Pooled(const torch::Tensor& x) {
  return torch::max_pool2d(x, {3, 3}, {2, 2}, {0, 0}, {1, 1}, /*ceil_mode=*/true);
}

torch::Tensor UnitChannels(const torch::Tensor& features) {
  return features / (features.square().sum(1, /*keepdim=*/true).sqrt() + 1e-10);
}

void CopyInto(const torch::Tensor& target, const std::map<std::string, torch::Tensor>& tensors, const std::string& name,
              const std::string& prefix, const std::string& where) {
  auto found = tensors.find(name);
  if (found == tensors.end()) found = tensors.find(prefix + name);
  if (found == tensors.end()) {
    Throw<DataError>("{}: no tensor '{}': not the weights of LPIPS v0.1 with SqueezeNet 1.1", where, name);
  }
  if (found->second.sizes() != target.sizes()) {
    Throw<DataError>("{}: tensor '{}' has shape {}, expected {}", where, name, ShapeString(found->second),
                     ShapeString(target));
  }
  target.copy_(found->second);
}

}  // namespace

FireImpl::FireImpl(int64_t in_channels, int64_t squeeze_channels, int64_t expand_channels) {
  squeeze_ = register_module("squeeze", Convolution(in_channels, squeeze_channels, 1, 1, 0));
  expand1x1_ = register_module("expand1x1", Convolution(squeeze_channels, expand_channels, 1, 1, 0));
  expand3x3_ = register_module("expand3x3", Convolution(squeeze_channels, expand_channels, 3, 1, 1));
}

torch::Tensor FireImpl::forward(const torch::Tensor& x) {
  const auto squeezed = torch::relu(squeeze_->forward(x));
  return torch::relu(torch::cat({expand1x1_->forward(squeezed), expand3x3_->forward(squeezed)}, 1));
}

LpipsImpl::LpipsImpl() {
  shift_ = register_buffer("shift", Column(kShift));
  scale_ = register_buffer("scale", Column(kScale));
  first_ = register_module("0", Convolution(3, kFirstChannels, 3, 2, 0));
  heads_.push_back(torch::ones({1, kFirstChannels, 1, 1}));
  for (const FireShape& shape : kFires) {
    fires_.push_back(register_module(std::to_string(shape.index), Fire(shape.in, shape.squeeze, shape.expand)));
    if (shape.is_feature) heads_.push_back(torch::ones({1, 2 * shape.expand, 1, 1}));
  }
  for (size_t i = 0; i < heads_.size(); ++i) heads_[i] = register_parameter("head" + std::to_string(i), heads_[i]);
  for (auto& parameter : parameters()) parameter.set_requires_grad(false);
}

void LpipsImpl::Load(const std::map<std::string, torch::Tensor>& backbone,
                     const std::map<std::string, torch::Tensor>& linear, const std::string& where) {
  torch::NoGradGuard no_grad;
  for (const auto& child : named_children()) {
    for (const auto& parameter : child.value()->named_parameters()) {
      CopyInto(parameter.value(), backbone, child.key() + "." + parameter.key(), "features.", where);
    }
  }
  for (size_t i = 0; i < heads_.size(); ++i) {
    CopyInto(heads_[i], linear, fmt::format("lin{}.model.1.weight", i), "", where);
  }
}

std::vector<torch::Tensor> LpipsImpl::Features(const torch::Tensor& images) {
  auto x = torch::relu(first_->forward((images - shift_) / scale_));
  std::vector<torch::Tensor> features = {x};
  for (size_t i = 0; i < kFires.size(); ++i) {
    if (kFires[i].pool_before) x = Pooled(x);
    x = fires_[i]->forward(x);
    if (kFires[i].is_feature) features.push_back(x);
  }
  return features;
}

torch::Tensor LpipsImpl::forward(const torch::Tensor& a, const torch::Tensor& b) {
  CheckShape(a, {kAny, 3, kAny, kAny}, "first image");
  CheckShape(b, {a.size(0), 3, a.size(2), a.size(3)}, "second image");
  if (std::min(a.size(2), a.size(3)) < kSmallestSide) {
    Throw<ShapeError>("LPIPS needs at least {} pixels along each side, found an image of {} x {}", kSmallestSide,
                      a.size(3), a.size(2));
  }
  const auto features_a = Features(a), features_b = Features(b);
  auto distance = torch::zeros({a.size(0)}, features_a[0].options());
  for (size_t i = 0; i < features_a.size(); ++i) {
    const auto difference = (UnitChannels(features_a[i]) - UnitChannels(features_b[i])).square();
    distance = distance + (difference * heads_[i]).sum(1).mean({1, 2});
  }
  return distance;
}

double LpipsImpl::Distance(const torch::Tensor& a, const torch::Tensor& b) {
  torch::NoGradGuard no_grad;
  CheckShape(a, {kAny, kAny, 3}, "first image");
  CheckShape(b, {a.size(0), a.size(1), 3}, "second image");
  const auto input = [&](const torch::Tensor& image) {
    return (image.to(shift_.options()) * 2 - 1).permute({2, 0, 1}).unsqueeze(0).contiguous();
  };
  return forward(input(a), input(b)).item<double>();
}

Lpips LoadLpips(const std::filesystem::path& backbone, const std::filesystem::path& linear) {
  Lpips lpips;
  lpips->Load(ReadPthArchive(backbone), ReadPthArchive(linear), backbone.string() + ", " + linear.string());
  lpips->eval();
  return lpips;
}

}  // namespace editnerf
