// The fast field's density activation: exp with its argument clamped to [-15, 15], in value and in gradient.
//
// Bounded by e^15 = 3.3e6 per scene unit for every pre-activation, and never without a gradient that leads back: beyond
// the clamp the gradient is that of the clamp's edge, so that an overshooting network recovers.
#pragma once

#include <ATen/core/Tensor.h>

namespace editnerf {

constexpr double kMaxLogDensity = 15;

// Any shape; same dtype and device. Differentiable once.
at::Tensor TruncatedExp(const at::Tensor& x);

}  // namespace editnerf
