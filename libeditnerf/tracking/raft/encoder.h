// The encoders of RAFT (Teed & Deng, "RAFT: Recurrent All-Pairs Field Transforms for Optical Flow", ECCV 2020,
// appendix): a 7 x 7 convolution, six residual blocks, a 1 x 1 convolution; an eighth of the image's size.
//
// Names of modules are those of the authors' published weights.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/batchnorm.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace editnerf {

enum class RaftNorm { kNone, kInstance, kBatch };

struct RaftEncoderOptions {
  bool bottleneck = false;             // blocks of 1 x 1, 3 x 3 and 1 x 1 kernels in place of two of 3 x 3
  std::array<int64_t, 3> widths = {};  // channels of the stages at 1/2, 1/4 and 1/8 of the size
  int64_t out = 0;                     // channels of the output
  RaftNorm norm = RaftNorm::kNone;     // after every convolution but the last
};

// A convolution that keeps the size (up to its stride), its normalisation and, if asked for, a ReLU.
class RaftConvolutions : public torch::nn::Module {
 protected:
  // Registers conv<suffix> and, for RaftNorm::kBatch, norm<suffix>; returns their index.
  size_t Add(const std::string& suffix, int64_t in, int64_t out, int64_t kernel, int64_t stride, RaftNorm norm);
  torch::Tensor Apply(size_t index, const torch::Tensor& x);

 private:
  struct Layer {
    torch::nn::Conv2d convolution = nullptr;
    torch::nn::BatchNorm2d batch_norm = nullptr;
    RaftNorm norm = RaftNorm::kNone;
  };
  std::vector<Layer> layers_;
};

// x [B, in, H, W] -> [B, out, ceil(H / stride), ceil(W / stride)].
class RaftBlockImpl : public RaftConvolutions {
 public:
  RaftBlockImpl(int64_t in, int64_t out, int64_t stride, const RaftEncoderOptions& options);
  torch::Tensor forward(const torch::Tensor& x);

 private:
  torch::nn::Sequential downsample_ = nullptr;  // of the shortcut; null where it changes nothing
  RaftNorm norm_;
  size_t num_layers_;
};
TORCH_MODULE(RaftBlock);

class RaftEncoderImpl : public RaftConvolutions {
 public:
  explicit RaftEncoderImpl(const RaftEncoderOptions& options);

  // images [B, 3, H, W] in [-1, 1], H and W multiples of 8 -> [B, out, H / 8, W / 8].
  torch::Tensor forward(const torch::Tensor& images);

 private:
  std::array<torch::nn::Sequential, 3> stages_ = {nullptr, nullptr, nullptr};  // "layer1" to "layer3"
};
TORCH_MODULE(RaftEncoder);

}  // namespace editnerf
