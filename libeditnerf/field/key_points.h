// The key points of all training frames, optimised together with the networks.
//
// EditableNeRF (Zheng et al., CVPR 2023), section 3.2 and its supplement. The optimised table holds every key point in
// coordinates of its own, so that one learning rate suits motions of any size:
//   q^i = s_i k^i + b_i,   s_i = 1 / max over axes of (90th - 10th percentile of the initial track),
//   b_i = -mean of the scaled initial track
// and eq. (3), the weighted key point: p(x') = sum_i w^i(x') k^i.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>

namespace editnerf {

// Scene units. An initial track that moves by less gets the scale of one that moves by this much, and a warning.
constexpr double kSmallestTrackRange = 0.01;

class KeyPointTableImpl : public torch::nn::Module {
 public:
  // Initial tracks [T, N, 3] in scene units, T frames in time order, N >= 1; the table takes their dtype and device.
  // Throws ShapeError, and DataError naming key point and frame unless they are finite.
  explicit KeyPointTableImpl(const torch::Tensor& tracks);

  // A table of this size to load a checkpoint into; until then all key points are 0 and local is scene.
  KeyPointTableImpl(int64_t num_frames, int64_t num_key_points);

  // time [F] int64 in [0, T) -> key points [F, N, 3] in scene units, differentiable. Throws ShapeError.
  torch::Tensor Positions(const torch::Tensor& time);

  // Between scene units and local coordinates, [..., N, 3]. Throw ShapeError.
  torch::Tensor ToLocal(const torch::Tensor& key_points) const;
  torch::Tensor FromLocal(const torch::Tensor& coordinates) const;

  int64_t num_frames() const { return local.size(0); }
  int64_t num_key_points() const { return local.size(1); }

  torch::Tensor local;   // parameter [T, N, 3], q
  torch::Tensor scale;   // buffer [N], s
  torch::Tensor offset;  // buffer [N, 3], b
};
TORCH_MODULE(KeyPointTable);

// weights [S, N], or undefined for N = 1; key_points [F, N, 3] in any coordinates, one row per state; state [S] int64
// -> the weighted key point of each sample, [S, 3]. Throws ShapeError.
torch::Tensor WeightedKeyPoint(const torch::Tensor& weights, const torch::Tensor& key_points,
                               const torch::Tensor& state);

}  // namespace editnerf
