#include "libeditnerf/render/compositing.h"

#include <cmath>
#include <vector>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

bool AllFinite(const torch::Tensor& tensor) { return torch::isfinite(tensor).all().item<bool>(); }

}  // namespace

TEST_CASE("weights of piecewise constant density are the exact integrals") {
  // The weight of [a, b] is exp(-integral to a) - exp(-integral to b).
  torch::manual_seed(1);
  const auto density = torch::rand({5, 40}, torch::kFloat64) * 20, delta = torch::rand({5, 40}, torch::kFloat64) * 0.1;
  const auto ray = ComputeRayWeights(density, delta, false);
  const auto up_to = (density * delta).cumsum(1);
  const auto before = up_to - density * delta;
  CHECK(torch::allclose(ray.weights, torch::exp(-before) - torch::exp(-up_to), 1e-12, 1e-14));
  CHECK(torch::allclose(ray.weights.sum(1), ray.opacity, 1e-13, 1e-14));
  CHECK(torch::allclose(ray.opacity + ray.transparency, torch::ones({5}, torch::kFloat64), 1e-13, 1e-14));
}

TEST_CASE("constant density does not depend on how finely it is cut") {
  const double sigma = 3, length = 0.7;
  for (const int64_t count : {1, 2, 17, 1000}) {
    const auto density = torch::full({1, count}, sigma, torch::kFloat64);
    const auto ray = ComputeRayWeights(density, torch::full_like(density, length / count), false);
    CHECK(ray.weights.sum().item<double>() == Approx(-std::expm1(-sigma * length)).epsilon(1e-12));
  }
}

TEST_CASE("an opaque end takes all light that is left and is no surface") {
  torch::manual_seed(2);
  const auto density = torch::rand({4, 9}, torch::kFloat64), delta = torch::rand({4, 9}, torch::kFloat64) * 0.1;
  const auto ray = ComputeRayWeights(density, delta, true);
  CHECK(torch::allclose(ray.weights.sum(1), torch::ones({4}, torch::kFloat64), 1e-14, 1e-14));
  CHECK(ray.transparency.abs().max().item<double>() == 0);
  CHECK(ray.opacity.max().item<double>() < 0.6);
  const auto t = torch::arange(9, torch::kFloat64).expand({4, 9});
  const auto surface = FindSurface(ray.weights, t, true);
  CHECK_FALSE(surface.valid.any().item<bool>());
  CHECK(torch::isnan(surface.depth).all().item<bool>());
  CHECK(FindSurface(ray.weights, t, false).valid.all().item<bool>());
  CHECK(ComputeRayWeights(density.narrow(1, 0, 1), delta.narrow(1, 0, 1), true).weights.min().item<double>() == 1);
}

TEST_CASE("float32 keeps the gradients of opaque intervals") {
  // dw/dtau = exp(-tau), and so for the opacity; 1 + expm1(-tau) would have lost all of it at tau = 17.
  for (const double tau : {0.1, 0.49, 0.51, 3.0, 10.0, 17.0, 40.0, 80.0}) {
    const auto density = torch::full({1, 1}, tau, torch::kFloat32).requires_grad_(true);
    const auto ray = ComputeRayWeights(density, torch::ones({1, 1}), false);
    const double exact = std::exp(-static_cast<double>(static_cast<float>(tau)));
    for (const auto& value : {ray.weights.sum(), ray.opacity.sum()}) {
      const auto gradient = torch::autograd::grad({value}, {density}, {}, true)[0];
      CHECK(gradient.item<double>() == Approx(exact).epsilon(1e-5));
    }
  }
}

TEST_CASE("weights and gradients are exact and finite from thin to stiff") {
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    const double rounding = dtype == torch::kFloat32 ? 1e-6 : 1e-14;
    for (int exponent = -12; exponent <= 12; ++exponent) {
      const double tau = std::pow(10.0, exponent);
      const auto density = torch::full({1, 8}, tau * 50, dtype).requires_grad_(true);
      const auto ray = ComputeRayWeights(density, torch::full({1, 8}, 0.02, dtype), false);
      CHECK(ray.weights[0][0].item<double>() == Approx(-std::expm1(-tau)).epsilon(2 * rounding));
      CHECK(ray.weights[0][1].item<double>() ==
            Approx(-std::expm1(-tau) * std::exp(-tau)).epsilon(20 * rounding).margin(1e-37));
      CHECK(ray.weights.sum().item<double>() <= 1 + rounding);
      (ray.weights * torch::arange(8, dtype)).sum().backward();
      CHECK(AllFinite(density.grad()));
    }
  }
}

TEST_CASE("alternating empty and stiff intervals give finite weights and gradients") {
  const auto tau = torch::tensor({{0.0, 1e12, 1e-12, 1e12, 0.0, 1.0}, {1e-12, 0.0, 1e-12, 0.5, 1e12, 1e-12}});
  for (const bool opaque : {false, true}) {
    const auto density = tau.clone().requires_grad_(true);
    const auto ray = ComputeRayWeights(density, torch::ones_like(tau), opaque);
    const auto radiance = torch::rand({2, 6, 3});
    const auto color = CompositeColor(ray, radiance, torch::rand({3}));
    const auto depth = ExpectedDepth(ray.weights, torch::arange(6, torch::kFloat32).expand({2, 6}));
    (color.sum() + depth.sum() + ray.opacity.sum()).backward();
    CHECK(AllFinite(color));
    CHECK(AllFinite(density.grad()));
    CHECK(ray.weights[0][1].item<float>() == 1);
    CHECK(ray.weights[0].sum().item<float>() == 1);
    CHECK(ray.weights[1][0].item<float>() == Approx(1e-12f));
    CHECK(ray.weights[1][2].item<float>() == Approx(1e-12f));
  }
}

TEST_CASE("no density is no surface, no depth and all background") {
  const auto density = torch::zeros({2, 5}).requires_grad_(true);
  const auto t = torch::arange(5, torch::kFloat32).expand({2, 5});
  const auto ray = ComputeRayWeights(density, torch::full({2, 5}, 0.1), false);
  const auto background = torch::tensor({0.2f, 0.4f, 0.6f});
  const auto color = CompositeColor(ray, torch::rand({2, 5, 3}), background);
  CHECK(torch::equal(color, background.expand({2, 3})));
  const auto depth = ExpectedDepth(ray.weights, t);
  CHECK(depth.abs().max().item<float>() == 0);
  CHECK_FALSE(FindSurface(ray.weights, t, false).valid.any().item<bool>());
  (color.sum() + depth.sum()).backward();
  CHECK(AllFinite(density.grad()));
}

TEST_CASE("the surface is the sample at which the accumulated weight first reaches one half") {
  const auto weights = torch::tensor(
      {{0.2, 0.2, 0.1, 0.5}, {0.5, 0.5, 0.0, 0.0}, {0.1, 0.1, 0.1, 0.19}, {0., 0., 0., 1.}}, torch::kFloat64);
  const auto t = torch::tensor({1., 2., 3., 4.}, torch::kFloat64).expand({4, 4});
  const auto surface = FindSurface(weights, t, false);
  CHECK(torch::equal(surface.index, torch::tensor({2, 0, 3, 3}, torch::kInt64)));
  CHECK(torch::equal(surface.valid, torch::tensor({true, true, false, true})));
  CHECK(surface.depth[0].item<double>() == 3);
  CHECK(std::isnan(surface.depth[2].item<double>()));
}

TEST_CASE("the distortion loss equals its double sum") {
  torch::manual_seed(3);
  const auto s = std::get<0>(torch::rand({3, 12}, torch::kFloat64).sort(1));
  const auto d = torch::rand({3, 12}, torch::kFloat64) * 0.1, w = torch::rand({3, 12}, torch::kFloat64) * 0.1;
  const auto pairs = w.unsqueeze(1) * w.unsqueeze(2) * (s.unsqueeze(1) - s.unsqueeze(2)).abs();
  const auto expected = pairs.sum({1, 2}) + (w * w * d).sum(1) / 3;
  CHECK(torch::allclose(DistortionLoss(w, s, d), expected, 1e-12, 1e-14));
  // Padding with weight 0 at s = 0 changes nothing.
  const auto zeros = torch::zeros({3, 4}, torch::kFloat64);
  const auto padded = DistortionLoss(torch::cat({w, zeros}, 1), torch::cat({s, zeros}, 1), torch::cat({d, zeros}, 1));
  CHECK(torch::allclose(padded, expected, 1e-12, 1e-14));
}

TEST_CASE("compositing agrees with central differences") {
  torch::manual_seed(4);
  const auto density = Leaf(torch::rand({2, 6}) * 5), radiance = Leaf(torch::rand({2, 6, 3}));
  const auto delta = torch::rand({2, 6}, torch::kFloat64) * 0.3, white = torch::ones({3}, torch::kFloat64);
  const auto t = std::get<0>(torch::rand({2, 6}, torch::kFloat64).sort(1));
  for (const bool opaque : {false, true}) {
    const auto rays = [&] { return ComputeRayWeights(density, delta, opaque); };
    CHECK(GradientError([&] { return CompositeColor(rays(), radiance, white); }, {density, radiance}) < 1e-7);
    CHECK(GradientError([&] { return ExpectedDepth(rays().weights, t); }, {density}) < 1e-7);
    CHECK(GradientError([&] { return DistortionLoss(rays().weights, t, delta); }, {density}) < 1e-7);
  }
}

TEST_CASE("compositing refuses rays without samples and mismatched shapes") {
  CHECK_THROWS_WITH(ComputeRayWeights(torch::zeros({2, 0}), torch::zeros({2, 0}), false),
                    "density: a ray needs at least one sample, found [2, 0]");
  CHECK_THROWS_AS(ComputeRayWeights(torch::zeros({2, 3}), torch::zeros({2, 4}), false), ShapeError);
}
