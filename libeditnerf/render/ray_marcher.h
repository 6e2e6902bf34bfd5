// Marching: equal steps along every ray, kept only where the space is occupied, in one packed list, and what that list
// shows. The kernels (ray_march, packed_compositing) do it on the CPU; elsewhere LibTorch's operations do, on samples
// padded to [R, S].
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>

#include "libeditnerf/kernels/ray_march.h"

namespace editnerf {

// Positions in `steps` equal intervals between near and far [R] -> t [R, steps]; every interval is
// (far - near) / steps long. `within` [R] in [0, 1] says where in its intervals a ray's samples lie.
torch::Tensor MarchCandidates(const torch::Tensor& near, const torch::Tensor& far, int64_t steps,
                              const torch::Tensor& within);

// The samples of t and delta [R, C] where keep [R, C] (bool). Where nothing at all is to be kept, the first sample of
// the first ray is, so that everything downstream has a sample and its gradients a path.
PackedSamples PackSamples(const torch::Tensor& t, const torch::Tensor& delta, const torch::Tensor& keep);

// The samples from t = start [R] on; where none remains, the first. Without gradients.
PackedSamples SamplesFrom(const PackedSamples& samples, const torch::Tensor& start);

// The samples that light still reaches, T_i >= early_stop > 0, asking for densities in waves of a few samples per ray,
// so that little behind the first opaque surface is evaluated. What lies behind cannot change the picture by more than
// early_stop; what lies in front always stays, also where it is empty. density(samples) -> [S]. No gradients.
PackedSamples MarchUntilOpaque(const PackedSamples& samples, double early_stop,
                               const std::function<torch::Tensor(const PackedSamples&)>& density);

// What packed samples show.
struct MarchedPicture {
  torch::Tensor rgb;             // [R, 3]; undefined without radiance
  torch::Tensor opacity;         // [R]
  torch::Tensor surface_sample;  // [R] int64 into the samples; any of them where there is no surface
  torch::Tensor depth;           // [R], t at the surface (FindSurface); NaN where there is none
  torch::Tensor depth_valid;     // [R] bool
  torch::Tensor distortion;      // [R], DistortionLoss in units of t; undefined unless asked for
  torch::Tensor weights;         // [S]
};

// density [S] and radiance [S, 3] (may be undefined) at the samples, background [3] or [R, 3] (black if undefined).
// Differentiable in all three.
MarchedPicture CompositeSamples(const PackedSamples& samples, const torch::Tensor& density,
                                const torch::Tensor& radiance, const torch::Tensor& background, bool with_distortion);

// The same by padding, on any device and for any types: the reference of the kernel.
MarchedPicture CompositePadded(const PackedSamples& samples, const torch::Tensor& density,
                               const torch::Tensor& radiance, const torch::Tensor& background, bool with_distortion);

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

}  // namespace editnerf
