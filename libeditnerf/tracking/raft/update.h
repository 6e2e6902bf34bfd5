// The recurrent update of RAFT (section 3.3 and appendix): what the correlation says about the present flow goes
// through a gated recurrent unit, whose state gives the flow's next change.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <array>
#include <cstdint>
#include <vector>

namespace editnerf {

// The two published networks.
struct RaftShape {
  bool bottleneck;                   // blocks of the encoders
  std::array<int64_t, 3> widths;     // of the encoders' stages
  int64_t features;                  // channels that are correlated
  int64_t hidden, context;           // channels of the recurrent state and of what stays the same
  int64_t radius;                    // of the correlation's look-up
  std::vector<int64_t> correlation;  // channels of the motion encoder's layers for the correlation,
  std::array<int64_t, 2> flow;       // for the flow
  int64_t motion;                    // and of its output
  int64_t flow_head;                 // hidden channels
  bool separable;                    // the recurrent unit has kernels of 1 x 5 and then 5 x 1 in place of 3 x 3
  bool convex;                       // learned weights enlarge the flow; bilinear otherwise

  static const RaftShape& Small();  // 990,162 parameters
  static const RaftShape& Large();  // 5,257,536 parameters
};

// Correlation [B, kLevels (2 r + 1)^2, H, W] and flow [B, 2, H, W] -> [B, motion, H, W], the flow its last channels.
class RaftMotionEncoderImpl : public torch::nn::Module {
 public:
  explicit RaftMotionEncoderImpl(const RaftShape& shape);
  torch::Tensor forward(const torch::Tensor& correlation, const torch::Tensor& flow);

 private:
  std::vector<torch::nn::Conv2d> correlation_;           // "convc1", "convc2"
  torch::nn::Conv2d flow1_ = nullptr, flow2_ = nullptr;  // "convf1", "convf2"
  torch::nn::Conv2d joint_ = nullptr;                    // "conv"
};
TORCH_MODULE(RaftMotionEncoder);

// Convolutional gated recurrent unit. state [B, hidden, H, W], input [B, in, H, W] -> the next state.
class RaftGruImpl : public torch::nn::Module {
 public:
  RaftGruImpl(int64_t hidden, int64_t in, bool separable);
  torch::Tensor forward(const torch::Tensor& state, const torch::Tensor& input);

 private:
  struct Pass {
    torch::nn::Conv2d z = nullptr, r = nullptr, q = nullptr;
  };
  std::vector<Pass> passes_;  // "convz1", "convr1", "convq1", and "convz2"... where separable
};
TORCH_MODULE(RaftGru);

class RaftFlowHeadImpl : public torch::nn::Module {
 public:
  RaftFlowHeadImpl(int64_t hidden, int64_t inner);
  torch::Tensor forward(const torch::Tensor& state);  // -> [B, 2, H, W], the flow's change

 private:
  torch::nn::Conv2d first_ = nullptr, second_ = nullptr;  // "conv1", "conv2"
};
TORCH_MODULE(RaftFlowHead);

class RaftUpdateImpl : public torch::nn::Module {
 public:
  explicit RaftUpdateImpl(const RaftShape& shape);

  // One step of the recurrent state; FlowChange reads the flow's change from it.
  torch::Tensor forward(const torch::Tensor& state, const torch::Tensor& context, const torch::Tensor& correlation,
                        const torch::Tensor& flow);
  torch::Tensor FlowChange(const torch::Tensor& state);  // -> [B, 2, H, W]
  // Logits of the weights with which nine neighbours make up each of 8 x 8 pixels, [B, 9 * 64, H, W]; undefined where
  // the network has none.
  torch::Tensor ConvexLogits(const torch::Tensor& state);

 private:
  RaftMotionEncoder encoder_ = nullptr;   // "encoder"
  RaftGru gru_ = nullptr;                 // "gru"
  RaftFlowHead flow_head_ = nullptr;      // "flow_head"
  torch::nn::Sequential mask_ = nullptr;  // "mask"
};
TORCH_MODULE(RaftUpdate);

}  // namespace editnerf
