#include "libeditnerf/field/spherical_harmonics.h"

#include <ATen/Functions.h>

#include <cmath>

#include "libeditnerf/base/shape.h"

namespace editnerf {

at::Tensor SphericalHarmonics(const at::Tensor& direction) {
  CheckShape(direction, {kAny, 3}, "spherical harmonics direction");
  const at::Tensor x = direction.select(1, 0), y = direction.select(1, 1), z = direction.select(1, 2);
  const at::Tensor xx = x * x, yy = y * y, zz = z * z, xy = x * y;
  // Normalisation: sqrt((2l + 1) / (4 pi) * (l - |m|)! / (l + |m|)!), times sqrt(2) for m != 0, written out per
  // function.
  const double c0 = std::sqrt(1 / (4 * M_PI));
  const double c1 = std::sqrt(3 / (4 * M_PI));
  const double c2 = std::sqrt(15 / (4 * M_PI)), c20 = std::sqrt(5 / (16 * M_PI));
  const double c33 = std::sqrt(35 / (32 * M_PI)), c32 = std::sqrt(105 / (4 * M_PI)), c31 = std::sqrt(21 / (32 * M_PI)),
               c30 = std::sqrt(7 / (16 * M_PI));
  return at::stack({at::full_like(x, c0), c1 * y, c1 * z, c1 * x, c2 * xy, c2 * y * z, c20 * (3 * zz - 1), c2 * x * z,
                    c2 / 2 * (xx - yy), c33 * y * (3 * xx - yy), c32 * xy * z, c31 * y * (5 * zz - 1),
                    c30 * z * (5 * zz - 3), c31 * x * (5 * zz - 1), c32 / 2 * z * (xx - yy), c33 * x * (xx - 3 * yy)},
                   1);
}

}  // namespace editnerf
