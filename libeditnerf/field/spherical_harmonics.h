// Real spherical harmonics of a unit direction up to degree 3: the 16 functions that the fast field's colour network
// sees.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

namespace editnerf {

constexpr int64_t kNumSphericalHarmonics = 16;

// direction [S, 3], unit length -> [S, 16], orthonormal over the sphere, ordered by degree and then order. Throws
// ShapeError.
at::Tensor SphericalHarmonics(const at::Tensor& direction);

}  // namespace editnerf
