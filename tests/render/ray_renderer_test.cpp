#include "libeditnerf/render/ray_renderer.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/render/image_renderer.h"
#include "tests/catch.h"
#include "tests/render/analytic_field.h"

using namespace editnerf;

namespace {

constexpr double kRadius = 0.3, kDensity = 200;
const Box kBox{{-1.5, -1.5, -1.5}, {1.5, 1.5, 1.5}};

RenderConfig ConfigFor(const std::string& sampler) {
  RenderConfig config;
  config.sampler = sampler;
  config.coarse_samples = 64;
  config.fine_samples = 64;
  config.march_steps = 200;
  config.occupancy_resolution = 32;
  return config;
}

RayRenderer MakeRenderer(const std::string& sampler) { return {ConfigFor(sampler), 0.1, 2.1, kBox}; }

// Rays from (x, y, -1) along z, for balls at depth 1 of the ray.
RayBatch ParallelRays(const torch::Tensor& xy, torch::Dtype dtype = torch::kFloat64) {
  RayBatch rays;
  rays.origin = torch::cat({xy, torch::full({xy.size(0), 1}, -1.0)}, 1).to(dtype);
  rays.direction = torch::tensor({{0.0, 0.0, 1.0}}, dtype).expand_as(rays.origin);
  rays.state = torch::zeros({xy.size(0)}, torch::kInt64);
  return rays;
}

const FrameStates kAtOrigin = BallStates(torch::zeros({1, 3}, torch::kFloat64));

Camera SmallCamera() {
  Camera camera;
  camera.position = {0, 0, -1};
  camera.focal_length = 20;
  camera.width = 20;
  camera.height = 14;
  camera.principal_point = {10, 7};
  return camera;
}

}  // namespace

TEST_CASE("both samplers see a ball's colour and depth, and nothing beside it") {
  for (const std::string sampler : {"hierarchical", "occupancy"}) {
    INFO(sampler);
    BallField field(kRadius, kDensity);
    auto renderer = MakeRenderer(sampler);
    torch::manual_seed(1);
    for (int update = 0; update < 8; ++update) renderer.UpdateOccupancy(field, kAtOrigin);
    const auto rays = ParallelRays(torch::tensor({{0.0, 0.0}, {0.1, -0.1}, {0.0, 0.2}, {0.5, 0.0}, {0.0, -0.9}}));
    RayOptions options;
    options.background = torch::tensor({1.0, 0.5, 0.25}, torch::kFloat64);
    const auto result = renderer.Render(field, rays, kAtOrigin, options);
    CHECK(torch::equal(result.depth_valid, torch::tensor({true, true, true, false, false})));
    CHECK(torch::isnan(result.depth.slice(0, 3)).all().item<bool>());
    const auto xy = rays.origin.slice(0, 0, 3).narrow(1, 0, 2);
    const auto front = torch::sqrt(kRadius * kRadius - xy.square().sum(1));
    CHECK(torch::allclose(result.depth.slice(0, 0, 3), 1 - front, 0, 0.02));
    const auto surface = torch::cat({xy, -front.unsqueeze(1)}, 1);
    CHECK(torch::allclose(result.rgb.slice(0, 0, 3), (surface / kRadius + 1) / 2, 0, 0.05));
    CHECK(torch::allclose(result.x_observed.slice(0, 0, 3), surface, 0, 0.02));
    CHECK(torch::allclose(result.opacity, result.depth_valid.to(torch::kFloat64), 0, 1e-3));
    CHECK(torch::allclose(result.rgb.slice(0, 3), options.background.expand({2, 3})));
    CHECK(result.rgb.dtype() == torch::kFloat64);
    CHECK_FALSE(result.weights.defined());
    CHECK_FALSE(result.rgb_coarse.defined());
    CHECK_FALSE(result.distortion.defined());
  }
}

TEST_CASE("occupancy grids and early stopping spare most evaluations without changing the picture") {
  BallField field(kRadius, kDensity);
  auto with = MakeRenderer("occupancy");
  torch::manual_seed(2);
  for (int update = 0; update < 8; ++update) with.UpdateOccupancy(field, kAtOrigin);
  auto without_config = ConfigFor("occupancy");
  without_config.early_stop = 0;
  RayRenderer without(without_config, 0.1, 2.1, kBox);
  const auto rays = ParallelRays(torch::rand({300, 2}) - 0.5);
  torch::NoGradGuard no_grad;
  const auto few = with.Render(field, rays, kAtOrigin, {}), all = without.Render(field, rays, kAtOrigin, {});
  CHECK(all.samples == 300 * 200);
  CHECK(few.samples < all.samples / 5);
  CHECK((few.rgb - all.rgb).abs().max().item<double>() <= 1e-3);
  CHECK(torch::equal(few.depth_valid, all.depth_valid));
}

TEST_CASE("depth alone is the depth of the picture, for fewer evaluations") {
  BallField field(kRadius, kDensity);
  auto renderer = MakeRenderer("occupancy");
  torch::manual_seed(1);
  for (int update = 0; update < 8; ++update) renderer.UpdateOccupancy(field, kAtOrigin);
  ImageOptions options;
  options.tensor = torch::kFloat64;
  field.evaluations = 0;
  const RenderedImage whole = RenderImage(field, renderer, SmallCamera(), kAtOrigin, options);
  const int64_t all = field.evaluations;
  options.depth_only = true;
  field.evaluations = 0;
  const RenderedImage depth = RenderImage(field, renderer, SmallCamera(), kAtOrigin, options);
  CHECK(torch::equal(whole.depth_valid, depth.depth_valid));
  CHECK(torch::equal(torch::nan_to_num(whole.depth, 0), torch::nan_to_num(depth.depth, 0)));
  CHECK_FALSE(depth.rgb.defined());
  CHECK(field.evaluations < all);
}

TEST_CASE("training gives gradients with both samplers, also for rays that hit nothing") {
  for (const std::string sampler : {"hierarchical", "occupancy"}) {
    for (const double x : {0.0, 0.9}) {
      BallField field(kRadius, 2, /*coarse=*/true);
      auto renderer = MakeRenderer(sampler);
      RayOptions options;
      options.training = true;
      options.distortion = true;
      const auto result = renderer.Render(field, ParallelRays(torch::full({3, 2}, x)), kAtOrigin, options);
      CHECK(result.rgb_coarse.defined() == (sampler == "hierarchical"));
      auto loss = result.rgb.square().sum() + result.opacity.sum() + result.distortion.sum();
      if (result.rgb_coarse.defined()) loss = loss + result.rgb_coarse.sum();
      loss.backward();
      const auto gradient = field.parameters()[0].grad();
      REQUIRE(gradient.defined());
      CHECK(std::isfinite(gradient.item<double>()));
      CHECK((gradient.item<double>() != 0) == (x == 0));
    }
  }
}

TEST_CASE("the renderer's gradient agrees with central differences") {
  for (const std::string sampler : {"hierarchical", "occupancy"}) {
    BallField field(kRadius, 2);
    auto renderer = MakeRenderer(sampler);
    const auto rays = ParallelRays(torch::tensor({{0.0, 0.0}, {0.1, 0.05}}));
    RayOptions options;
    options.background = torch::ones({3}, torch::kFloat64);
    const auto loss = [&] { return renderer.Render(field, rays, kAtOrigin, options).rgb.square().sum(); };
    loss().backward();
    auto strength = field.parameters()[0];
    // A small step, because sample positions of the second pass follow the weights and carry no gradient.
    const double step = sampler == "occupancy" ? 1e-5 : 1e-7;
    torch::NoGradGuard no_grad;
    strength.add_(step);
    const double above = loss().item<double>();
    strength.sub_(2 * step);
    const double below = loss().item<double>();
    CHECK((above - below) / (2 * step) ==
          Approx(strength.grad().item<double>()).epsilon(sampler == "occupancy" ? 1e-6 : 0.05));
  }
}

TEST_CASE("every ray is rendered in its own state, and a moving part stays visible everywhere") {
  BallField field(kRadius, kDensity);
  const auto states = BallStates(torch::tensor({{-0.5, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.5, 0.0, 0.0}}, torch::kFloat64));
  auto rays = ParallelRays(torch::tensor({{-0.5, 0.0}, {0.0, 0.0}, {0.5, 0.0}, {-0.5, 0.0}}));
  rays.state = torch::tensor({0, 1, 2, 2}, torch::kInt64);
  const std::optional<Box> none, local = Box{{-2, -2, -2}, {2, 2, 2}};
  for (const auto& local_box : {none, local}) {
    RayRenderer renderer(ConfigFor("occupancy"), 0.1, 2.1, kBox, local_box);
    torch::manual_seed(3);
    for (int update = 0; update < 20; ++update) renderer.UpdateOccupancy(field, states);
    const auto result = renderer.Render(field, rays, states, {});
    CHECK(torch::equal(result.depth_valid, torch::tensor({true, true, true, false})));
  }
}

TEST_CASE("marching in single precision, by the kernels, shows what double precision shows") {
  BallField field(kRadius, kDensity);
  const std::optional<Box> none, local = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
  auto states = BallStates(torch::tensor({{0.1, 0.0, 0.2}}, torch::kFloat64));
  for (const auto& local_box : {none, local}) {
    RayRenderer renderer(ConfigFor("occupancy"), 0.1, 2.1, kBox, local_box);
    torch::manual_seed(5);
    for (int update = 0; update < 8; ++update) renderer.UpdateOccupancy(field, states);
    const auto xy = torch::rand({200, 2}) - 0.5;
    RayOptions options;
    options.distortion = true;
    options.background = torch::ones({3});
    const auto fine = renderer.Render(field, ParallelRays(xy), states, options);
    states.key_points = states.key_points.to(torch::kFloat32);
    const auto fast = renderer.Render(field, ParallelRays(xy, torch::kFloat32), states, options);
    states.key_points = states.key_points.to(torch::kFloat64);
    CHECK(fast.rgb.dtype() == torch::kFloat32);
    CHECK(std::abs(fast.samples - fine.samples) <= fine.samples / 100);
    // A ray whose sample lies on the ball's rim may differ.
    const auto differ = (fast.rgb - fine.rgb).abs().amax(1) > 1e-4;
    CHECK(differ.sum().item<int64_t>() < 3);
    CHECK(((fast.distortion - fine.distortion).abs() > 1e-4).sum().item<int64_t>() < 3);
    CHECK(fast.depth_valid.ne(fine.depth_valid).sum().item<int64_t>() < 3);
  }
}

TEST_CASE("covering an edit's state makes a part visible where training never saw it") {
  BallField field(kRadius, kDensity);
  RayRenderer renderer(ConfigFor("occupancy"), 0.1, 2.1, kBox, Box{{-2, -2, -2}, {2, 2, 2}});
  torch::manual_seed(4);
  for (int update = 0; update < 20; ++update) renderer.UpdateOccupancy(field, kAtOrigin);
  const auto moved = BallStates(torch::tensor({{0.9, 0.0, 0.0}}, torch::kFloat64));
  const auto rays = ParallelRays(torch::tensor({{0.9, 0.0}}));
  CHECK_FALSE(renderer.Render(field, rays, moved, {}).depth_valid.item<bool>());
  renderer.CoverStates(field, moved);
  CHECK(renderer.Render(field, rays, moved, {}).depth_valid.item<bool>());
}

TEST_CASE("an image does not depend on its chunks and says where there is no surface") {
  for (const std::string sampler : {"hierarchical", "occupancy"}) {
    BallField field(kRadius, kDensity);
    auto renderer = MakeRenderer(sampler);
    ImageOptions options;
    options.tensor = torch::kFloat64;
    const auto whole = RenderImage(field, renderer, SmallCamera(), kAtOrigin, options);
    options.chunk = 37;
    const auto pieces = RenderImage(field, renderer, SmallCamera(), kAtOrigin, options);
    CHECK(whole.rgb.sizes() == torch::IntArrayRef({14, 20, 3}));
    CHECK(torch::allclose(whole.rgb, pieces.rgb, 1e-12, 1e-12));
    CHECK(torch::equal(whole.depth_valid, pieces.depth_valid));
    CHECK(torch::equal(whole.depth.nan_to_num(-1), pieces.depth.nan_to_num(-1)));
    CHECK(torch::equal(torch::isnan(whole.depth), whole.depth_valid.logical_not()));
    CHECK(whole.samples == pieces.samples);
    CHECK(whole.depth_valid[7][10].item<bool>());
    CHECK(whole.depth[7][10].item<double>() == Approx(0.7).margin(0.02));
    CHECK_FALSE(whole.depth_valid[0][0].item<bool>());
    CHECK(whole.ambient.sizes() == torch::IntArrayRef({14, 20, 3}));
    CHECK_FALSE(whole.weights.defined());
    CHECK_FALSE(whole.rgb.requires_grad());
  }
}

TEST_CASE("the renderer refuses settings that cannot work") {
  auto config = ConfigFor("sideways");
  CHECK_THROWS_WITH(RayRenderer(config, 0.1, 2, kBox),
                    "render.sampler: found 'sideways', expected 'hierarchical' or 'occupancy'");
  CHECK_THROWS_WITH(RayRenderer(ConfigFor("occupancy"), 2, 1, kBox),
                    "renderer: near 2, far 1: expected 0 <= near < far");
}
