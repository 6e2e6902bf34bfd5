// Volume rendering of packed samples on the CPU: the equations of render/compositing.h over the samples
// offsets[r] .. offsets[r + 1] - 1 of each ray r, without padding and without an opaque end. Sums run in double.
//
// float32 and float64; every function throws ShapeError for other types, devices or shapes, and its result does not
// depend on the number of threads.
#pragma once

#include <ATen/core/Tensor.h>

namespace editnerf {

struct PackedPicture {
  at::Tensor weights;       // [S], >= 0; those of a ray sum to at most 1, up to rounding
  at::Tensor transparency;  // [R]
  at::Tensor opacity;       // [R]
  at::Tensor rgb;           // [R, 3]; undefined without radiance
};

// density and delta [S], >= 0; offsets [R + 1] int64; radiance [S, 3] or undefined; background [3] or [R, 3], black if
// undefined. A ray without samples shows the background. Differentiable once in density, radiance and background.
PackedPicture CompositePacked(const at::Tensor& density, const at::Tensor& delta, const at::Tensor& offsets,
                              const at::Tensor& radiance = {}, const at::Tensor& background = {});

// The surface of each ray: the sample at which the accumulated weight first reaches 0.5.
struct PackedSurface {
  at::Tensor sample;  // [R] int64 into the samples; any of them where there is no surface
  at::Tensor depth;   // [R], t there; NaN where there is no surface
  at::Tensor valid;   // [R] bool
};

// weights and t [S], S >= 1. Without gradients.
PackedSurface FindPackedSurface(const at::Tensor& weights, const at::Tensor& t, const at::Tensor& offsets);

// Distortion loss of each ray [R] as DistortionLoss has it, with t [S], ascending along each ray, for the interval
// centres and delta [S] for their lengths, and in their unit. Differentiable once in the weights [S].
at::Tensor PackedDistortion(const at::Tensor& weights, const at::Tensor& t, const at::Tensor& delta,
                            const at::Tensor& offsets);

}  // namespace editnerf
