// Real spherical harmonics of degrees 0 to 3 on the unit sphere, orthonormal; in the order of
// field/spherical_harmonics.h.
#pragma once

#include <array>
#include <cmath>

namespace editnerf {

constexpr int kNumHarmonics = 16;

// For tensors and for single numbers; `one` is a 1 of the same kind.
template <class T>
std::array<T, kNumHarmonics> Harmonics(const T& x, const T& y, const T& z, const T& one) {
  // Normalisation: sqrt((2l + 1) / (4 pi) * (l - |m|)! / (l + |m|)!), times sqrt(2) for m != 0, written out per
  // function.
  static const double k0 = std::sqrt(1 / (4 * M_PI)), k1 = std::sqrt(3 / (4 * M_PI)), k2 = std::sqrt(15 / (4 * M_PI)),
                      k20 = std::sqrt(5 / (16 * M_PI)), k33 = std::sqrt(35 / (32 * M_PI)),
                      k32 = std::sqrt(105 / (4 * M_PI)), k31 = std::sqrt(21 / (32 * M_PI)),
                      k30 = std::sqrt(7 / (16 * M_PI));
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

}  // namespace editnerf
