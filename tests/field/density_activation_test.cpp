#include "libeditnerf/field/density_activation.h"

#include <torch/types.h>

#include <cmath>

#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

TEST_CASE("the density is the softplus of its pre-activation to rounding") {
  for (const double y : {-700.0, -30.0, -1.0, 0.0, 1.0, 19.0, 21.0, 39.9, 40.1, 1e4}) {
    const double expected = y > 0 ? y + std::log1p(std::exp(-y)) : std::log1p(std::exp(y));
    const auto found = DensityFromPreactivation(torch::tensor(y, torch::kFloat64));
    CHECK(found.item<double>() == Approx(expected).epsilon(1e-14).margin(0));
  }
  const auto y = Leaf(torch::linspace(-5, 45, 11, torch::kFloat64));
  CHECK(GradientError([&] { return DensityFromPreactivation(y); }, {y}) < 1e-7);
}

TEST_CASE("density and gradient are finite and bounded for pre-activations up to 1e4 either way") {
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    auto y = torch::tensor({-1e4, -100.0, -50.0, 0.0, 39.0, 50.0, 100.0, 1e4}, torch::kFloat64).to(dtype);
    y.set_requires_grad(true);
    const auto density = DensityFromPreactivation(y);
    CHECK(density.isfinite().all().item<bool>());
    CHECK(density.min().item<double>() >= 0);
    density.sum().backward();
    CHECK(y.grad().min().item<double>() >= 0);
    CHECK(y.grad().max().item<double>() <= 1);
    CHECK(y.grad()[3].item<double>() == 0.5);
  }
}
