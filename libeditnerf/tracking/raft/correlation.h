// All-pairs correlation of two feature maps, and its look-up around a flow (RAFT, section 3.2).
//
//   C(p, q) = <f(p), g(q)> / sqrt(channels), averaged over 2 x 2, 4 x 4 and 8 x 8 places q
//   look-up: at level l, bilinear samples of C(p, .) at x(p) / 2^l + d, d in {-r..r}^2; 0 outside the map
// A level that has no place left, because the map is too small, answers 0 everywhere.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

namespace editnerf {

class RaftCorrelation {
 public:
  static constexpr int64_t kLevels = 4;

  // from, to [B, C, H, W] float32, CPU. Takes 4 B (H W)^2 bytes and a third more. Throws ShapeError.
  RaftCorrelation(const torch::Tensor& from, const torch::Tensor& to, int64_t radius);

  // places [B, 2, H, W] float32: for each place of `from` the position (x, y) in `to`, place centres at whole numbers
  // -> [B, kLevels (2 r + 1)^2, H, W]; of the channels of a level, those of one horizontal offset lie together, as in
  // the published network. Not differentiable.
  torch::Tensor Lookup(const torch::Tensor& places) const;

 private:
  int64_t radius_, height_, width_;
  std::vector<torch::Tensor> levels_;  // [B, H W, H / 2^l, W / 2^l]
};

}  // namespace editnerf
