#include "libeditnerf/kernels/packed_compositing.h"

#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/render/compositing.h"
#include "libeditnerf/render/ray_marcher.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

// Rays with random samples; the first, the last and some between have none.
PackedSamples RandomSamples(int64_t rays, int64_t steps, double share) {
  auto keep = torch::rand({rays, steps}) < share;
  for (const int64_t empty : {int64_t{0}, rays / 2, rays - 1}) keep[empty].fill_(false);
  const auto t = std::get<0>(torch::rand({rays, steps}, torch::kFloat64).sort(1));
  return PackSamples(t, torch::rand({rays, steps}, torch::kFloat64) * 0.1, keep);
}

PackedPicture CompositeDense(const PackedSamples& samples, const torch::Tensor& density, const torch::Tensor& radiance,
                             const torch::Tensor& background) {
  const RayPadding padding(samples);
  const auto rays = ComputeRayWeights(padding.Pad(density), padding.Pad(samples.delta), false);
  return {padding.Unpad(rays.weights), rays.transparency, rays.opacity,
          CompositeColor(rays, padding.Pad(radiance), background)};
}

torch::Tensor AllOf(const PackedPicture& picture) {
  return torch::cat({picture.weights, picture.transparency, picture.opacity, picture.rgb.flatten()});
}

bool AllFinite(const torch::Tensor& tensor) { return torch::isfinite(tensor).all().item<bool>(); }

}  // namespace

TEST_CASE("packed compositing equals padded compositing in values and gradients") {
  torch::manual_seed(1);
  for (const double share : {0.0, 0.1, 0.9}) {
    const auto samples = RandomSamples(150, 40, share);
    const int64_t count = samples.t.size(0);
    const auto density = Leaf(torch::rand({count}) * 60), radiance = Leaf(torch::rand({count, 3}));
    for (const auto& background : {torch::Tensor(), Leaf(torch::rand({3})), Leaf(torch::rand({150, 3}))}) {
      const auto packed = CompositePacked(density, samples.delta, samples.offsets, radiance, background);
      const auto dense = CompositeDense(samples, density, radiance, background);
      CHECK(torch::allclose(AllOf(packed), AllOf(dense), 1e-12, 1e-14));
      std::vector<torch::Tensor> leaves{density, radiance};
      if (background.defined()) leaves.push_back(background);
      const auto upstream = torch::randn_like(AllOf(dense));
      const auto found = torch::autograd::grad({(AllOf(packed) * upstream).sum()}, leaves);
      const auto expected = torch::autograd::grad({(AllOf(dense) * upstream).sum()}, leaves);
      for (size_t i = 0; i < leaves.size(); ++i) CHECK(torch::allclose(found[i], expected[i], 1e-11, 1e-13));
    }
  }
}

TEST_CASE("each output of packed compositing alone has the gradient that central differences find") {
  torch::manual_seed(2);
  const auto samples = RandomSamples(8, 6, 0.7);
  const int64_t count = samples.t.size(0);
  const auto density = Leaf(torch::rand({count}) * 20), radiance = Leaf(torch::rand({count, 3})),
             background = Leaf(torch::rand({8, 3}));
  const auto picture = [&] { return CompositePacked(density, samples.delta, samples.offsets, radiance, background); };
  CHECK(GradientError([&] { return picture().weights; }, {density}) < 1e-7);
  CHECK(GradientError([&] { return picture().transparency; }, {density}) < 1e-7);
  CHECK(GradientError([&] { return picture().opacity; }, {density}) < 1e-7);
  CHECK(GradientError([&] { return picture().rgb; }, {density, radiance, background}) < 1e-7);
  CHECK(GradientError([&] { return AllOf(picture()); }, {density, radiance, background}) < 1e-7);
  const auto no_color = [&] { return CompositePacked(density, samples.delta, samples.offsets).weights; };
  CHECK(GradientError(no_color, {density}) < 1e-7);
}

TEST_CASE("packed compositing is exact and finite from thin to stiff") {
  const auto offsets = torch::tensor({0, 8}, torch::kInt64);
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    const double rounding = dtype == torch::kFloat32 ? 1e-6 : 1e-14;
    for (int exponent = -12; exponent <= 12; ++exponent) {
      const double tau = std::pow(10.0, exponent);
      const auto density = torch::full({8}, tau * 50, dtype).requires_grad_(true);
      const auto ray = CompositePacked(density, torch::full({8}, 0.02, dtype), offsets, torch::ones({8, 3}, dtype));
      CHECK(ray.weights[0].item<double>() == Approx(-std::expm1(-tau)).epsilon(2 * rounding));
      CHECK(ray.weights[1].item<double>() ==
            Approx(-std::expm1(-tau) * std::exp(-tau)).epsilon(20 * rounding).margin(1e-37));
      CHECK(ray.opacity.item<double>() == Approx(-std::expm1(-8 * tau)).epsilon(2 * rounding));
      CHECK(ray.weights.sum().item<double>() <= 1 + rounding);
      (ray.weights * torch::arange(8, dtype)).sum().backward();
      CHECK(AllFinite(density.grad()));
    }
  }
}

TEST_CASE("packed compositing of alternating empty and stiff intervals is finite") {
  const auto tau = torch::tensor({0.0, 1e12, 1e-12, 1e12, 0.0, 1.0, 1e-12, 0.0, 1e-12, 0.5, 1e38, 1e-12});
  const auto density = tau.clone().requires_grad_(true), radiance = torch::rand({12, 3}).requires_grad_(true);
  const auto ray = CompositePacked(density, torch::full({12}, 1.5), torch::tensor({0, 6, 12}, torch::kInt64), radiance,
                                   torch::rand({3}));
  (ray.rgb.sum() + ray.opacity.sum() + ray.weights.square().sum()).backward();
  CHECK(AllFinite(AllOf(ray)));
  CHECK(AllFinite(density.grad()));
  CHECK(AllFinite(radiance.grad()));
  CHECK(ray.weights[1].item<float>() == 1);
  CHECK(ray.weights.slice(0, 0, 6).sum().item<float>() == 1);
  CHECK(ray.weights[6].item<float>() == Approx(1.5e-12f));
  CHECK(ray.weights[8].item<float>() == Approx(1.5e-12f));
}

TEST_CASE("packed surface and distortion equal the padded ones") {
  torch::manual_seed(3);
  const auto samples = RandomSamples(150, 40, 0.6);
  const RayPadding padding(samples);
  const auto density = torch::rand({samples.t.size(0)}, torch::kFloat64) * 40;
  const auto weights = CompositePacked(density, samples.delta, samples.offsets).weights.requires_grad_(true);
  const auto surface = FindPackedSurface(weights, samples.t, samples.offsets);
  const auto expected = FindSurface(padding.Pad(weights), padding.Pad(samples.t), false);
  CHECK(surface.valid.any().item<bool>());
  CHECK(torch::equal(surface.valid, expected.valid));
  CHECK(torch::equal(surface.depth.nan_to_num(-1), expected.depth.nan_to_num(-1)));
  CHECK(torch::equal(surface.depth.index({surface.valid}),
                     samples.t.index_select(0, surface.sample).index({surface.valid})));
  CHECK(((surface.sample >= 0) & (surface.sample < samples.t.size(0))).all().item<bool>());

  const auto packed = PackedDistortion(weights, samples.t, samples.delta, samples.offsets);
  const auto dense = DistortionLoss(padding.Pad(weights), padding.Pad(samples.t), padding.Pad(samples.delta));
  CHECK(torch::allclose(packed, dense, 1e-11, 1e-14));
  const auto upstream = torch::randn_like(dense);
  CHECK(torch::allclose(torch::autograd::grad({(packed * upstream).sum()}, {weights})[0],
                        torch::autograd::grad({(dense * upstream).sum()}, {weights})[0], 1e-11, 1e-13));
  const auto leaf = Leaf(density);
  const auto loss = [&] {
    return PackedDistortion(CompositePacked(leaf, samples.delta, samples.offsets).weights, samples.t, samples.delta,
                            samples.offsets);
  };
  CHECK(GradientError(loss, {leaf}) < 1e-7);
}

TEST_CASE("packed compositing of no samples shows the background, and passes nothing else on") {
  torch::manual_seed(4);
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    const auto offsets = torch::zeros({8}, torch::kInt64);
    const auto density = torch::zeros({0}, dtype).requires_grad_(true), delta = torch::zeros({0}, dtype);
    const auto radiance = torch::zeros({0, 3}, dtype).requires_grad_(true);
    const auto background = torch::rand({7, 3}, dtype).requires_grad_(true);
    const auto picture = CompositePacked(density, delta, offsets, radiance, background);
    CHECK(picture.weights.size(0) == 0);
    CHECK(torch::equal(picture.transparency, torch::ones({7}, dtype)));
    CHECK(torch::equal(picture.opacity, torch::zeros({7}, dtype)));
    CHECK(torch::equal(picture.rgb, background));
    const auto upstream = torch::randn({7, 3}, dtype);
    const auto grads = torch::autograd::grad({(picture.rgb * upstream).sum()}, {density, radiance, background});
    CHECK(grads[0].sizes() == density.sizes());
    CHECK(grads[1].sizes() == radiance.sizes());
    CHECK(torch::equal(grads[2], upstream));
    CHECK(torch::equal(CompositePacked(density, delta, offsets, radiance).rgb, torch::zeros({7, 3}, dtype)));
    CHECK(torch::equal(PackedDistortion(picture.weights, delta, delta, offsets), torch::zeros({7}, dtype)));
  }
}

TEST_CASE("packed compositing refuses other types and shapes by name") {
  const auto offsets = torch::tensor({0, 2, 3}, torch::kInt64);
  const auto three = torch::zeros({3});
  CHECK_THROWS_WITH(CompositePacked(three, torch::zeros({4}), offsets), "delta: expected shape [3], found [4]");
  CHECK_THROWS_WITH(CompositePacked(torch::zeros({4}), torch::zeros({4}), offsets),
                    "packed offsets: expected 4 as the last, found 3");
  CHECK_THROWS_WITH(CompositePacked(three, three.to(torch::kFloat64), offsets),
                    "packed delta: expected float32 or float64 on the CPU, one type for all, found CPUDoubleType");
  CHECK_THROWS_AS(CompositePacked(three, three, offsets.to(torch::kInt32)), ShapeError);
}
