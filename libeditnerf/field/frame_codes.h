// One learned code per training frame: beta_t of the warp, alpha_t of the appearance.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>

namespace editnerf {

class FrameCodesImpl : public torch::nn::Module {
 public:
  // num_frames T >= 1, dim D >= 1; codes start as U(0, init). Throws ConfigError.
  FrameCodesImpl(int64_t num_frames, int64_t dim, double init);

  // time [F] int64 in [0, T) -> [F, D], differentiable in the table. Throws ShapeError.
  torch::Tensor forward(const torch::Tensor& time);

  int64_t num_frames() const { return table.size(0); }
  int64_t dim() const { return table.size(1); }

  torch::Tensor table;  // parameter [T, D]
};
TORCH_MODULE(FrameCodes);

}  // namespace editnerf
