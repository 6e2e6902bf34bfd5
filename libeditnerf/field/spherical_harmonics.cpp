#include "libeditnerf/field/spherical_harmonics.h"

#include <ATen/Functions.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

// Normalisation: sqrt((2l + 1) / (4 pi) * (l - |m|)! / (l + |m|)!), times sqrt(2) for m != 0, written out per function.
const double k0 = std::sqrt(1 / (4 * M_PI));
const double k1 = std::sqrt(3 / (4 * M_PI));
const double k2 = std::sqrt(15 / (4 * M_PI)), k20 = std::sqrt(5 / (16 * M_PI));
const double k33 = std::sqrt(35 / (32 * M_PI)), k32 = std::sqrt(105 / (4 * M_PI)), k31 = std::sqrt(21 / (32 * M_PI)),
             k30 = std::sqrt(7 / (16 * M_PI));

// For tensors and for single numbers; `one` is a 1 of the same kind.
template <class T>
std::array<T, kNumSphericalHarmonics> Harmonics(const T& x, const T& y, const T& z, const T& one) {
  const T xx = x * x, yy = y * y, zz = z * z, xy = x * y;
  return {one * k0,
          y * k1,
          z * k1,
          x * k1,
          xy * k2,
          y * z * k2,
          (zz * 3 - one) * k20,
          x * z * k2,
          (xx - yy) * (k2 / 2),
          y * (xx * 3 - yy) * k33,
          xy * z * k32,
          y * (zz * 5 - one) * k31,
          z * (zz * 5 - one * 3) * k30,
          x * (zz * 5 - one) * k31,
          z * (xx - yy) * (k32 / 2),
          x * (xx - yy * 3) * k33};
}

}  // namespace

at::Tensor SphericalHarmonics(const at::Tensor& direction) {
  CheckShape(direction, {kAny, 3}, "spherical harmonics direction");
  if (direction.requires_grad() || !direction.device().is_cpu() || direction.scalar_type() != at::kFloat) {
    const at::Tensor x = direction.select(1, 0), y = direction.select(1, 1), z = direction.select(1, 2);
    const auto functions = Harmonics<at::Tensor>(x, y, z, at::ones_like(x));
    return at::stack(at::TensorList(functions.data(), functions.size()), 1);
  }
  const at::Tensor rows = direction.contiguous();
  at::Tensor out = at::empty({rows.size(0), kNumSphericalHarmonics}, rows.options());
  const float* const in = rows.data_ptr<float>();
  float* const values = out.data_ptr<float>();
  ParallelFor(rows.size(0), 4096, [&](int64_t begin, int64_t end) {
    for (int64_t s = begin; s < end; ++s) {
      const auto row = Harmonics<double>(in[3 * s], in[3 * s + 1], in[3 * s + 2], 1.0);
      std::copy(row.begin(), row.end(), values + s * kNumSphericalHarmonics);
    }
  });
  return out;
}

}  // namespace editnerf
