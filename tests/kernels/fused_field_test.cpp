// The fused kernels against the modules: a HyperspaceField differentiates the same objective both ways.
#include "libeditnerf/kernels/fused_field.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/render/ray_renderer.h"
#include "libeditnerf/training/losses.h"
#include "tests/catch.h"
#include "tests/kernels/each_target.h"
#include "tests/kernels/fused_field_fixture.h"

using namespace editnerf;

namespace {

Found CheckAgainstModules(const Setting& setting, HyperspaceField& field, const RayBatch& rays,
                          const RayObjective& objective, const RayOptions& options) {
  INFO("stage " << static_cast<int>(setting.stage) << ", " << setting.key_points << " key points, appearance "
                << setting.appearance << ", direction " << setting.direction << ", " << setting.rays << " rays, "
                << setting.steps << " steps, early stop " << setting.early_stop << ", turning " << setting.turning
                << ", shade " << setting.shade);
  RayRenderer renderer = MakeRenderer(field, setting);
  const Found exact = ModuleByModule(field, renderer, rays, options, objective, torch::kFloat64);
  const Found expected = ModuleByModule(field, renderer, rays, options, objective, torch::kFloat32);
  Found found = Fused(field, renderer, rays, options, objective);
  CHECK(found.samples == expected.samples);
  CHECK(found.reconstruction == Approx(expected.reconstruction).epsilon(1e-5));
  CHECK(found.distortion == Approx(expected.distortion).epsilon(1e-5));
  CHECK(found.depth == Approx(expected.depth).epsilon(1e-5).margin(1e-12));
  CHECK(found.ambient == Approx(expected.ambient).epsilon(1e-5).margin(1e-12));
  CheckGradients(found.gradients, expected.gradients, exact.gradients);
  return found;
}

void CheckAgainstModules(const Setting& setting) {
  const auto field = MakeField(setting);
  const RayBatch rays = RandomRays(setting.rays);
  const RayObjective objective = ObjectiveFor(setting);
  RayOptions options = RandomOptions(setting.rays);
  options.distance.slice(0, 0, setting.rays, 3).fill_(NAN);
  if (setting.start) options.start = (torch::rand({setting.rays}) - 0.2) * kFar;
  CheckAgainstModules(setting, *field, rays, objective, options);
}

// Rays in the cube from -1 to 1 with steps of 1/8 from 5/16 on, all of which float32 holds exactly: a sample on a lower
// face is in the cube, one on an upper face is not.
RayBatch RaysAtFaces() {
  const float below = 1 - 0x1p-22F;  // still in the cube once -1 is subtracted
  RayBatch rays;
  rays.origin = torch::tensor({{-1.3125F, 0.1F, 0.2F},             // first on a face, last before the opposite one
                               {0.3F, -0.0625F, 0.2F},             // last on a face
                               {-0.7F, -1.0F, 0.1F},               // in a lower face
                               {-1.0F, -1.0F, -1.0F},              // along a lower edge
                               {1.1F, 0.4F, below},                // just below an upper face
                               {0.2F, 1.0F, -1.0F},                // in an upper face
                               {-0.34375F, -0.34375F, -0.34375F},  // last in a corner
                               {0.2F, 0.2F, 0.2F}});               // out through a corner
  rays.direction = torch::tensor({{1.0F, 0.0F, 0.0F},
                                  {0.0F, -1.0F, 0.0F},
                                  {1.0F, 0.0F, 0.0F},
                                  {0.0F, 1.0F, 0.0F},
                                  {-1.0F, 0.0F, 0.0F},
                                  {0.0F, 0.0F, 1.0F},
                                  {-0.5F, -0.5F, -0.5F},
                                  {0.5F, 0.5F, 0.5F}});
  rays.state = torch::randint(kFrames, {8}, torch::kInt64);
  return rays;
}
constexpr int64_t kSamplesAtFaces = 16 + 6 + 12 + 14 + 15 + 0 + 9 + 11;

}  // namespace

TEST_CASE("fused gradients are those of the modules for one to eight key points, and for none") {
  torch::manual_seed(1);
  for (int64_t key_points = 0; key_points <= 8; ++key_points) {
    Setting setting;
    setting.key_points = key_points;
    CheckAgainstModules(setting);
  }
}

TEST_CASE("fused gradients are those of the modules where parts turn") {
  torch::manual_seed(11);
  for (int64_t key_points = 1; key_points <= 8; ++key_points) {
    Setting setting;
    setting.key_points = key_points;
    setting.turning = true;
    setting.appearance = key_points == 2;
    CheckAgainstModules(setting);
  }
}

TEST_CASE("fused gradients are those of the modules where parts shade others") {
  torch::manual_seed(18);
  for (int64_t key_points = 1; key_points <= 8; ++key_points) {
    Setting setting;
    setting.key_points = key_points;
    setting.shade = true;
    setting.turning = key_points == 3;
    setting.appearance = key_points % 2 == 0;
    setting.direction = key_points < 5;
    const auto field = MakeField(setting);
    const Found found = CheckAgainstModules(setting, *field, RandomRays(setting.rays), ObjectiveFor(setting),
                                            RandomOptions(setting.rays));
    const auto table = found.gradients.find("fine.shade_table");
    REQUIRE((table != found.gradients.end()) == (key_points > 1));  // with one, the local encoding has it all
    if (key_points > 1) CHECK(table->second.abs().sum().item<double>() > 0);
  }
}

TEST_CASE("rays count for their emphasis, and what each has missed is without it") {
  ForEachTarget([] {
    torch::manual_seed(19);
    for (const int64_t rays : {1, 63, 130}) {
      Setting setting;
      setting.rays = rays;
      const auto field = MakeField(setting);
      const RayBatch batch = RandomRays(rays);
      RayObjective objective = ObjectiveFor(setting);
      const RayOptions options = RandomOptions(rays);
      RayRenderer renderer = MakeRenderer(*field, setting);
      const auto missed = [&] {
        const RayGradients found = *renderer.AddGradients(*field, batch, AllStates(*field), options, objective);
        GradientsOf(*field);
        return found.missed;
      };
      const torch::Tensor plain = missed();
      objective.emphasis = 3 * torch::rand({rays});
      objective.emphasis[0] = 0;
      CheckAgainstModules(setting, *field, batch, objective, options);
      CHECK(torch::equal(missed(), plain));
      const RayResult seen = renderer.Render(*field, batch, AllStates(*field), options);
      CHECK(torch::allclose(plain, (seen.rgb - objective.target).square().mean(1), 1e-4, 1e-6));
    }
  });
}

TEST_CASE("fused gradients are those of the modules while fine levels of the local hash come in") {
  torch::manual_seed(12);
  for (const int64_t step : {0, 30, 70, 100}) {
    Setting setting;
    setting.key_points = step == 30 ? 1 : 2;
    setting.window_steps = 100;
    setting.step = step;
    CheckAgainstModules(setting);
  }
}

TEST_CASE("fused gradients of pretraining are those of the modules") {
  torch::manual_seed(2);
  Setting setting;
  setting.stage = FieldStage::kPretrain;
  CheckAgainstModules(setting);
  setting.appearance = true;
  CheckAgainstModules(setting);
}

TEST_CASE("fused gradients are those of the modules with and without what a scene may not need") {
  torch::manual_seed(3);
  for (const int64_t key_points : {1, 2}) {
    for (const bool appearance : {false, true}) {
      for (const bool direction : {false, true}) {
        Setting setting;
        setting.key_points = key_points;
        setting.appearance = appearance;
        setting.direction = direction;
        CheckAgainstModules(setting);
      }
    }
  }
}

TEST_CASE("fused gradients are those of the modules for odd numbers of rays and samples") {
  torch::manual_seed(4);
  for (const int64_t rays : {1, 2, 7, 63, 64, 65, 200}) {
    for (const int64_t steps : {2, 7, 33}) {
      Setting setting;
      setting.rays = rays;
      setting.steps = steps;
      setting.key_points = 2;
      CheckAgainstModules(setting);
    }
  }
}

TEST_CASE("fused gradients are those of the modules wherever rays begin and end") {
  torch::manual_seed(5);
  for (const double early_stop : {0.0, 1e-3, 0.4}) {
    for (const double bias : {-3.0, 3.0}) {
      Setting setting;
      setting.start = bias < 0 || early_stop > 0;
      setting.early_stop = early_stop;
      setting.density_bias = bias;
      setting.steps = 60;
      CheckAgainstModules(setting);
    }
  }
}

TEST_CASE("fused gradients are those of the modules for every instruction set of this machine") {
  ForEachTarget([] {
    torch::manual_seed(6);
    Setting setting;
    setting.key_points = 3;
    setting.appearance = true;
    CheckAgainstModules(setting);
    setting.turning = true;
    CheckAgainstModules(setting);
    setting.shade = true;
    CheckAgainstModules(setting);
    setting.key_points = 1;
    CheckAgainstModules(setting);
    setting.turning = false;
    CheckAgainstModules(setting);
    setting.stage = FieldStage::kPretrain;
    CheckAgainstModules(setting);
  });
}

TEST_CASE("fused gradients are those of the modules for odd numbers of samples, for every instruction set") {
  ForEachTarget([] {
    torch::manual_seed(14);
    constexpr int64_t kSamples[] = {1, 7, 63, 65};
    for (int64_t key_points = 0; key_points <= 8; ++key_points) {
      const int64_t samples = kSamples[key_points % 4];
      Setting setting = OneRay(samples, key_points);
      setting.turning = samples > 7;
      setting.shade = key_points % 2 == 0;
      setting.appearance = samples == 7;
      const auto field = MakeField(setting);
      const RayBatch rays = RayInside();
      const RayObjective objective = ObjectiveFor(setting);
      const Found found = CheckAgainstModules(setting, *field, rays, objective, RandomOptions(setting.rays));
      CHECK(found.samples == samples);
    }
  });
}

TEST_CASE("fused gradients are those of the modules for rays that end on the box or graze it") {
  ForEachTarget([] {
    torch::manual_seed(16);
    for (const int64_t key_points : {0, 1, 3}) {
      Setting setting;
      setting.stage = key_points == 0 ? FieldStage::kPretrain : FieldStage::kTrain;
      setting.key_points = key_points;
      setting.early_stop = 0;
      setting.box = {{-1, -1, -1}, {1, 1, 1}};
      setting.near = 0.25, setting.far = 3.25;
      const RayBatch rays = RaysAtFaces();
      setting.rays = rays.origin.size(0);
      const auto field = MakeField(setting);
      const RayObjective objective = ObjectiveFor(setting);
      RayOptions options = RandomOptions(setting.rays);
      options.jitter.fill_(0.5);
      const Found found = CheckAgainstModules(setting, *field, rays, objective, options);
      CHECK(found.samples == kSamplesAtFaces);
    }
  });
}

TEST_CASE("fused gradients are the same bits in every run with as many threads") {
  torch::manual_seed(10);
  Setting setting;
  setting.key_points = 2;
  setting.rays = 150;
  const auto field = MakeField(setting);
  const RayBatch rays = RandomRays(setting.rays);
  const RayObjective objective = ObjectiveFor(setting);
  RayOptions options;
  options.jitter = torch::rand({setting.rays});
  std::optional<Found> first;
  for (int run = 0; run < 4; ++run) {
    RayRenderer renderer(ConfigFor(setting), kNear, kFar, kBox);
    const Found found = Fused(*field, renderer, rays, options, objective);
    if (!first) first = found;
    CHECK(found.reconstruction == first->reconstruction);
    for (const auto& [name, gradient] : first->gradients) {
      INFO(name);
      CHECK(torch::equal(found.gradients.at(name), gradient));
    }
  }
}

TEST_CASE("only the fast field without warp in float32 offers itself to the kernels") {
  Setting setting;
  CHECK(MakeField(setting)->Fused().has_value());
  auto options = OptionsFor(setting);
  options.config.warp.enabled = Choice::kOn;
  CHECK_FALSE(HyperspaceField(options).Fused().has_value());
  options = OptionsFor(setting);
  options.config.kind = "paper";
  CHECK_FALSE(HyperspaceField(options).Fused().has_value());
  options = OptionsFor(setting);
  options.config.fast.canonical_hash.features_per_level = 4;
  CHECK_FALSE(HyperspaceField(options).Fused().has_value());
  const auto field = MakeField(setting);
  field->to(torch::kFloat64);
  CHECK_FALSE(field->Fused().has_value());
}

TEST_CASE("fused kernels refuse states that do not fit") {
  Setting setting;
  setting.key_points = 2;
  const auto field = MakeField(setting);
  RayRenderer renderer(ConfigFor(setting), kNear, kFar, kBox);
  RayBatch rays = RandomRays(3);
  const torch::NoGradGuard no_grad;
  CHECK_THROWS_AS(renderer.Render(*field, rays, {}, {}), ShapeError);
  FrameStates one;
  one.key_points = torch::zeros({1, 1, 3});
  CHECK_THROWS_AS(renderer.Render(*field, rays, one, {}), ShapeError);
  FrameStates fewer = AllStates(*field);
  fewer.casters = fewer.key_points.slice(0, 1);
  CHECK_THROWS_WITH(renderer.Render(*field, rays, fewer, {}), HasText("casters"));
  rays.state = torch::full({3}, kFrames, torch::kInt64);
  CHECK_THROWS_AS(renderer.Render(*field, rays, AllStates(*field), {}), ShapeError);
}
