// Optical flow along a sequence, checked forwards and backwards.
#pragma once

#include <torch/types.h>

#include <functional>

#include "libeditnerf/tracking/optical_flow.h"

namespace editnerf {

// T images give T - 1 pairs. Pair i is the images i and i + 1.
struct FlowSequence {
  torch::Tensor forward;         // [T-1, H, W, 2] float32, from image i to i + 1
  torch::Tensor backward;        // [T-1, H, W, 2] float32, from image i + 1 to i
  torch::Tensor forward_valid;   // [T-1, H, W] bool
  torch::Tensor backward_valid;  // [T-1, H, W] bool

  int64_t num_frames() const { return forward.size(0) + 1; }
};

// Where forward flow F and backward flow B agree: |F(p) + B(p + F(p))|^2 <= 0.01 (|F|^2 + |B|^2) + 0.5 pixel^2, the
// usual test for occlusion (Sundaram et al., ECCV 2010). False where a flow is not finite or leads out of the image.
// [H, W, 2] twice -> [H, W] bool, for the pixels of `flow`.
torch::Tensor ForwardBackwardValid(const torch::Tensor& flow, const torch::Tensor& opposite);

// Fills in the two masks from the two flows.
void Validate(FlowSequence* sequence);

// images [T, H, W, 3] uint8, T >= 2; pairs are computed on all threads. Throws Interrupted when the user asks to stop.
// `guess(from, to)`, where given, is what the flow between two of the images begins from (OpticalFlow::FlowFrom).
using FlowGuess = std::function<torch::Tensor(int64_t from, int64_t to)>;
FlowSequence ComputeFlowSequence(const torch::Tensor& images, const OpticalFlow& flow, const FlowGuess& guess = {});

}  // namespace editnerf
