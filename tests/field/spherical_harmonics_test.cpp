#include "libeditnerf/field/spherical_harmonics.h"

#include <torch/nn/functional.h>
#include <torch/types.h>

#include <cmath>

#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("spherical harmonics are orthonormal over the sphere") {
  // Midpoints in the azimuth and in cos(polar angle), an equal-area grid.
  const int64_t n = 200;
  const auto u = (torch::arange(n, torch::kFloat64) + 0.5) / n;
  const auto azimuth = (2 * M_PI * u).repeat({n}), z = (2 * u - 1).repeat_interleave(n);
  const auto radius = (1 - z * z).sqrt();
  const auto h = SphericalHarmonics(torch::stack({radius * azimuth.cos(), radius * azimuth.sin(), z}, 1));
  const auto gram = 4 * M_PI / static_cast<double>(n * n) * torch::mm(h.t(), h);
  CHECK((gram - torch::eye(16, torch::kFloat64)).abs().max().item<double>() < 1e-3);
}

TEST_CASE("spherical harmonics in single precision, by the loop, are those of double precision") {
  const auto d = torch::nn::functional::normalize(torch::randn({50, 3}, torch::kFloat64));
  const auto found = SphericalHarmonics(d.to(torch::kFloat32)).to(torch::kFloat64);
  CHECK((found - SphericalHarmonics(d)).abs().max().item<double>() < 1e-6);
}
