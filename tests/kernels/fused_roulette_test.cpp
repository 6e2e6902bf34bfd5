// Gradients that go back by lot (RayLoss::roulette) against those of all samples.
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/render/ray_renderer.h"
#include "tests/catch.h"
#include "tests/kernels/fused_field_fixture.h"

using namespace editnerf;

TEST_CASE("fused gradients of samples drawn by lot are those of all samples on the mean") {
  torch::manual_seed(21);
  Setting setting;
  setting.key_points = 2;
  setting.shade = setting.appearance = true;
  setting.rays = 150;
  const auto field = MakeField(setting);
  RayRenderer renderer = MakeRenderer(*field, setting);
  const RayBatch rays = RandomRays(setting.rays);
  RayOptions options = RandomOptions(setting.rays);
  RayObjective objective = ObjectiveFor(setting);
  // The lot is in what a jitter has beyond multiples of 1/4096, which hardly moves samples.
  const torch::Tensor coarse = (options.jitter * 4096).floor() / 4096;
  constexpr int kDraws = 200;
  const auto add = [&](const Found& found, Gradients* mean) {
    for (const auto& [name, gradient] : found.gradients) {
      torch::Tensor& sum = (*mean)[name];
      sum = (sum.defined() ? sum : torch::zeros_like(gradient)) + gradient / kDraws;
    }
  };
  const auto relative = [](const torch::Tensor& found, const torch::Tensor& expected) {
    return (found - expected).norm().item<double>() / (expected.norm().item<double>() + 1e-12);
  };
  Gradients mean_of_all, mean_of_some;
  double apart = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    options.jitter = coarse + (draw + 0.5) / kDraws / 4096;
    objective.roulette = 0;
    const Found all = Fused(*field, renderer, rays, options, objective);
    objective.roulette = 0.05;
    const Found some = Fused(*field, renderer, rays, options, objective);
    CHECK(some.reconstruction == all.reconstruction);  // the loss is of all samples
    add(all, &mean_of_all);
    add(some, &mean_of_some);
    apart = std::max(apart, relative(some.gradients.at("fine.local_table"), all.gradients.at("fine.local_table")));
  }
  CHECK(apart > 0.1);  // one draw by itself is not
  for (const auto& [name, gradient] : mean_of_all) {
    INFO(name);
    CHECK(relative(mean_of_some.at(name), gradient) < 0.03);
  }
}

TEST_CASE("few samples of rays that are right already go back, and those that are not finite always do") {
  torch::manual_seed(22);
  Setting setting;
  setting.rays = 64;
  const auto field = MakeField(setting);
  RayRenderer renderer = MakeRenderer(*field, setting);
  const RayBatch rays = RandomRays(setting.rays);
  RayOptions options;
  options.jitter = torch::rand({setting.rays});
  RayObjective objective;
  objective.target = torch::rand({setting.rays, 3});
  const auto returned = [&](double roulette) {
    objective.roulette = roulette;
    const auto found = renderer.AddGradients(*field, rays, AllStates(*field), options, objective);
    REQUIRE(found.has_value());
    CHECK(found->returned <= found->samples);
    return static_cast<double>(found->returned) / static_cast<double>(found->samples);
  };
  CHECK(returned(0) == 1);
  const double some = returned(0.05), few = returned(0.5);
  CHECK(some < 0.9);
  CHECK(few < some);
  CHECK(few > 0);
  GradientsOf(*field);
  objective.target[3][1] = NAN;
  CHECK(returned(0.5) > few);
  CHECK(GradientsOf(*field).at("fine.canonical_table").isnan().any().item<bool>());
}
