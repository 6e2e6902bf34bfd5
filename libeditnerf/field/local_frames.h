// How parts turn as their key points move: one orientation for every key point, from its position alone.
//
//   r^i(k) = W2^i tanh(W1^i q + b1^i) + b2^i,   q: the key point in local coordinates (key_points.h)
//   a part's own coordinates: R^i (x' - k^i),   R^i = exp([r^i])^T
//
// In them a part that turns as it moves, such as a lid on its hinge, stands still. EditableNeRF (Zheng et al., CVPR
// 2023) has x' and p alone, in which every angle is a shape of its own; the local frame is ours, evaluated once for
// every state and key point, not for samples. What turns while its key point rests cannot be told by it.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>

namespace editnerf {

class LocalFramesImpl : public torch::nn::Module {
 public:
  // Frames that do not turn, to load a checkpoint into.
  explicit LocalFramesImpl(int64_t num_key_points);

  // Fitted to known turns: coordinates [T, N, 3] local, turns [T, N, 3] rotation vectors in radians, from the part's
  // own axes to the scene's; those of a hinge beyond the ends of its way as well (hinge_way.h). Throws ShapeError, and
  // DataError unless all are finite.
  LocalFramesImpl(const torch::Tensor& coordinates, const torch::Tensor& turns);

  // coordinates [F, N, 3] -> R [F, N, 3, 3], from scene axes to the parts' own. Throws ShapeError.
  torch::Tensor forward(const torch::Tensor& coordinates);

  // The rotation vectors r [F, N, 3], from the parts' own axes to the scene's.
  torch::Tensor RotationVectors(const torch::Tensor& coordinates);

  int64_t num_key_points() const { return hidden_weight_.size(0); }

 private:
  void Fit(int64_t key_point, const torch::Tensor& coordinates, const torch::Tensor& turns);  // [T, 3]
  torch::Tensor Hidden(const torch::Tensor& coordinates) const;                               // [N, F, H]

  torch::Tensor hidden_weight_, hidden_bias_;  // [N, 3, H], [N, 1, H]
  torch::Tensor output_weight_, output_bias_;  // [N, H, 3], [N, 1, 3]
};
TORCH_MODULE(LocalFrames);

// x [S, 3], weights [S, N] or undefined for N = 1, key_points [F, N, 3], frames [F, N, 3, 3], state [S] int64
// -> sum_i w^i R^i (x - k^i), [S, 3]. Throws ShapeError.
torch::Tensor InLocalFrames(const torch::Tensor& x, const torch::Tensor& weights, const torch::Tensor& key_points,
                            const torch::Tensor& frames, const torch::Tensor& state);

// The same turns [T, N, 3], of rotations in [0, pi], without jumps: each is near that of the frame before, by whole
// turns about its axis.
torch::Tensor UnwrapTurns(const torch::Tensor& turns);

}  // namespace editnerf
