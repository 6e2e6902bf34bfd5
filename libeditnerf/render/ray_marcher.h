// Marching: equal steps along every ray, kept only where the space is occupied, in one packed list.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>

namespace editnerf {

// Samples of R rays in ray order, ascending along each ray.
struct PackedSamples {
  torch::Tensor ray;      // [S] int64, ascending
  torch::Tensor t;        // [S]
  torch::Tensor delta;    // [S], length of the interval that the sample stands for
  torch::Tensor offsets;  // [R + 1] int64: samples of ray r are offsets[r] .. offsets[r + 1] - 1
};

// Positions in `steps` equal intervals between near and far [R] -> t [R, steps]; every interval is
// (far - near) / steps long. `within` [R] in [0, 1] says where in its intervals a ray's samples lie.
torch::Tensor MarchCandidates(const torch::Tensor& near, const torch::Tensor& far, int64_t steps,
                              const torch::Tensor& within);

// The samples of t and delta [R, C] where keep [R, C] (bool). Where nothing at all is to be kept, the first sample of
// the first ray is, so that everything downstream has a sample and its gradients a path.
PackedSamples PackSamples(const torch::Tensor& t, const torch::Tensor& delta, const torch::Tensor& keep);

// Those among packed samples where keep [S]; the same exception.
PackedSamples SelectSamples(const PackedSamples& samples, const torch::Tensor& keep);

// The samples that light still reaches (ReachedSamples), asking for densities in waves of a few samples per ray, so
// that little behind the first opaque surface is evaluated. density(samples) -> [S]. No gradients.
PackedSamples MarchUntilOpaque(const PackedSamples& samples, double early_stop,
                               const std::function<torch::Tensor(const PackedSamples&)>& density);

// Packed to dense: where each sample goes in a [R, width] array, width = the largest count (at least 1).
class RayPadding {
 public:
  explicit RayPadding(const PackedSamples& samples);

  // values [S, ...] -> [R, width, ...], zeros behind each ray's samples. Differentiable.
  torch::Tensor Pad(const torch::Tensor& values) const;

  // padded [R, width, ...] -> [S, ...]. Differentiable.
  torch::Tensor Unpad(const torch::Tensor& padded) const;

  int64_t width() const { return width_; }

 private:
  int64_t rays_, width_;
  torch::Tensor position_;  // [S] int64 into [R * width]
};

// bool [S]: samples that light still reaches, T_i >= early_stop, given density [S] of all of them. What lies behind
// cannot change the picture by more than early_stop; what lies in front always stays, also where it is empty.
torch::Tensor ReachedSamples(const PackedSamples& samples, const torch::Tensor& density, double early_stop);

}  // namespace editnerf
