// Volume rendering along rays.
//
// Interval i of a ray holds one density sigma_i over the length delta_i, tau_i = sigma_i delta_i:
//   T_i = exp(-sum_{j<i} tau_j)      alpha_i = 1 - exp(-tau_i)      w_i = T_i alpha_i
// NeRF (Mildenhall et al., ECCV 2020), eq. (3). Transmittance is the exponential of a running sum and alpha comes from
// expm1, so that weights are exact from tau = 1e-12 to 1e12, and neither values nor gradients are ever NaN for finite
// input. Rays with fewer samples than others are padded with density 0, which changes nothing.
#pragma once

#include <torch/types.h>

namespace editnerf {

struct RayWeights {
  torch::Tensor weights;       // [R, S], >= 0; they sum to at most 1, up to rounding
  torch::Tensor transparency;  // [R], the share of light that passes every interval; 0 with an opaque end
  torch::Tensor opacity;       // [R], 1 - exp(-sum tau); an opaque end does not count
};

// density and delta [R, S], S >= 1, both >= 0. With `opaque_end` the last sample stops all light that reaches it (the
// paper's habit: alpha = 1, whatever its density), and neither its density nor its delta is read.
RayWeights ComputeRayWeights(const torch::Tensor& density, const torch::Tensor& delta, bool opaque_end);

// Colour [R, 3] of radiance [R, S, 3]; what passes the ray shows `background` ([3] or [R, 3]; black if undefined).
torch::Tensor CompositeColor(const RayWeights& ray, const torch::Tensor& radiance,
                             const torch::Tensor& background = {});

// Mean distance [R] of the weights along t [R, S], relative to their sum; 0 where that is below 1e-12.
torch::Tensor ExpectedDepth(const torch::Tensor& weights, const torch::Tensor& t);

// The surface of each ray: the sample at which the accumulated weight first reaches 0.5.
struct SurfaceSample {
  torch::Tensor index;  // [R] int64; the last sample where there is no surface
  torch::Tensor depth;  // [R], t at the index; NaN where there is no surface
  torch::Tensor valid;  // [R] bool
};

// Without gradients. With `opaque_end` a ray that only the last sample stops has no surface.
SurfaceSample FindSurface(const torch::Tensor& weights, const torch::Tensor& t, bool opaque_end);

// Distortion loss of each ray [R] (mip-NeRF 360, Barron et al., CVPR 2022, eq. (15)):
//   sum_ij w_i w_j |s_i - s_j| + 1/3 sum_i w_i^2 d_i
// s [R, S]: interval centres in [0, 1], ascending where the weights are not 0; d [R, S]: interval lengths in the same
// unit. Linear in S by prefix sums.
torch::Tensor DistortionLoss(const torch::Tensor& weights, const torch::Tensor& s, const torch::Tensor& d);

}  // namespace editnerf
