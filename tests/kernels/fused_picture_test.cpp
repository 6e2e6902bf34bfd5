// What the fused kernels show, pictures and densities, against the modules.
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>

#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/kernels/fused_field.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/render/ray_renderer.h"
#include "tests/catch.h"
#include "tests/kernels/each_target.h"
#include "tests/kernels/fused_field_fixture.h"

using namespace editnerf;

TEST_CASE("rays without samples show the background and give no gradient") {
  ForEachTarget([] {
    torch::manual_seed(7);
    for (const int64_t key_points : {0, 1, 3}) {
      Setting setting;
      setting.rays = 5;
      setting.key_points = key_points;
      const auto field = MakeField(setting);
      RayRenderer renderer = MakeRenderer(*field, setting);
      RayBatch rays = RandomRays(5);
      rays.origin = rays.origin + 100;
      RayOptions options;
      options.background = torch::rand({5, 3});
      options.distortion = true;
      RayObjective objective = ObjectiveFor(setting);
      const auto found = Fused(*field, renderer, rays, options, objective);
      CHECK(found.samples == 0);
      CHECK(found.reconstruction == Approx((options.background - objective.target).square().mean().item<double>()));
      for (const auto& [name, gradient] : found.gradients) CHECK(gradient.abs().sum().item<double>() == 0);
      const torch::NoGradGuard no_grad;
      options.distortion = false;
      const auto seen = renderer.Render(*field, rays, AllStates(*field), options);
      CHECK(torch::equal(seen.rgb, options.background));
      CHECK_FALSE(seen.depth_valid.any().item<bool>());
      CHECK(torch::isnan(seen.depth).all().item<bool>());
    }
  });
}

TEST_CASE("fused pictures are those of the modules") {
  ForEachTarget([] {
    torch::manual_seed(8);
    for (const int64_t key_points : {1, 3}) {
      Setting setting;
      setting.key_points = key_points;
      setting.rays = 300;
      setting.steps = 40;
      setting.density_bias = 2;
      setting.turning = setting.shade = key_points == 3;
      const auto field = MakeField(setting);
      RayRenderer renderer(ConfigFor(setting), kNear, kFar, kBox);
      const RayBatch rays = RandomRays(setting.rays);
      RayOptions options;
      options.background = torch::tensor({0.2F, 0.5F, 0.9F});
      const RayResult expected = renderer.Render(*field, rays, AllStates(*field), options);  // with gradients
      const torch::NoGradGuard no_grad;
      const RayResult found = renderer.Render(*field, rays, AllStates(*field), options);
      CHECK(found.samples == expected.samples);
      CHECK(RelativeDifference(found.rgb, expected.rgb) < 1e-5);
      CHECK(RelativeDifference(found.opacity, expected.opacity) < 1e-5);
      CHECK(torch::equal(found.depth_valid, expected.depth_valid));
      CHECK(torch::allclose(found.depth, expected.depth, 1e-5, 1e-6, /*equal_nan=*/true));
      const auto valid = found.depth_valid;
      REQUIRE(valid.any().item<bool>());
      for (const auto member :
           {&RayResult::x_observed, &RayResult::x_canonical, &RayResult::ambient, &RayResult::weights}) {
        REQUIRE((found.*member).defined() == (expected.*member).defined());
        if ((found.*member).defined()) {
          CHECK(RelativeDifference((found.*member).index({valid}), (expected.*member).index({valid})) < 1e-5);
        }
      }
      options.depth_only = true;
      const RayResult depth = renderer.Render(*field, rays, AllStates(*field), options);
      CHECK(torch::allclose(depth.depth, found.depth, 1e-6, 1e-6, /*equal_nan=*/true));
      CHECK_FALSE(depth.rgb.defined());
    }
  });
}

TEST_CASE("fused densities are those of the modules, inside, on and outside the box, for any number of points") {
  // The middle, and the middles of faces and edges, and the corners.
  const auto at_box =
      torch::cartesian_prod({torch::linspace(kBox.low.x, kBox.high.x, 3), torch::linspace(kBox.low.y, kBox.high.y, 3),
                             torch::linspace(kBox.low.z, kBox.high.z, 3)});
  ForEachTarget([&] {
    torch::manual_seed(9);
    for (const int64_t key_points : {0, 1, 2, 8}) {
      for (const int64_t count : {0, 1, 7, 63, 64, 65, 1000}) {
        INFO(key_points << " key points, " << count << " points");
        Setting setting;
        setting.stage = key_points == 0 ? FieldStage::kPretrain : FieldStage::kTrain;
        setting.key_points = key_points;
        const auto field = MakeField(setting);
        const torch::NoGradGuard no_grad;
        FieldInput input;
        input.x_observed = torch::rand({count, 3}) * 3 - 1.5;
        const int64_t some = std::min(count / 2, at_box.size(0));
        input.x_observed.slice(0, 0, some).copy_(at_box.slice(0, 0, some));
        input.state = torch::randint(kFrames, {count}, torch::kInt64);
        const FrameStates states = AllStates(*field);
        const auto expected = field->EvaluateDensity(input, states, Level::kFine).density;
        const auto found =
            FusedDensity(FieldKernel(*field->Fused(), FusedStatesOf(*field, states)), input.x_observed, input.state);
        CHECK(RelativeDifference(found, expected) < 1e-5);
      }
    }
  });
}
