#include "libeditnerf/field/spherical_harmonics.h"

#include <ATen/Functions.h>

#include <algorithm>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/harmonics.h"
#include "libeditnerf/kernels/kernel_use.h"

namespace editnerf {

static_assert(kNumSphericalHarmonics == kNumHarmonics);

at::Tensor SphericalHarmonics(const at::Tensor& direction) {
  CheckShape(direction, {kAny, 3}, "spherical harmonics direction");
  if (direction.requires_grad() || !KernelsTake(direction)) {
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
