// The fused kernels in bfloat16 against the modules in float64.
#include <torch/types.h>
#include <torch/utils.h>

#include "tests/catch.h"
#include "tests/kernels/fused_field_fixture.h"

using namespace editnerf;

namespace {

// All gradients in one vector.
torch::Tensor Joined(const Gradients& gradients) {
  std::vector<torch::Tensor> parts;
  for (const auto& item : gradients) parts.push_back(item.second.flatten().to(torch::kFloat64));
  return torch::cat(parts);
}

}  // namespace

TEST_CASE("fused gradients in bfloat16 are those of float32 but for rounding") {
  if (FastestBf16() == Bf16Unit::kNone) {
    WARN("this processor has no bfloat16 products: skipped");
    return;
  }
  for (const Bf16Unit unit : Bf16UnitsHere()) {
    const Bf16Limit limit(unit);
    torch::manual_seed(13);
    for (int64_t key_points = 1; key_points <= 8; ++key_points) {
      INFO(NameOf(unit) << ", " << key_points << " key points");
      Setting setting;
      setting.key_points = key_points;
      setting.shade = key_points % 2 == 1;
      setting.early_stop = 0;  // the same samples, whatever their densities
      setting.kernel = "bf16";
      const auto field = MakeField(setting);
      REQUIRE(field->Fused()->bf16 == unit);
      RayRenderer renderer = MakeRenderer(*field, setting);
      const RayBatch rays = RandomRays(setting.rays);
      const RayObjective objective = ObjectiveFor(setting);
      const RayOptions options = RandomOptions(setting.rays);
      const Found exact = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat64);
      const Found found = Fused(*field, renderer, rays, options, objective);
      CHECK(found.samples == exact.samples);
      CHECK(found.reconstruction == Approx(exact.reconstruction).epsilon(0.01));
      CHECK(found.distortion == Approx(exact.distortion).epsilon(0.02));
      for (const auto& [name, gradient] : exact.gradients) {
        INFO(name);
        // What reaches the weights is a small difference of what their key points would get.
        const double allowed = name.rfind("weights.", 0) == 0 ? 0.25 : 0.1;
        CHECK(RelativeDifference(found.gradients.at(name).to(torch::kFloat64), gradient) < allowed);
      }
    }
  }
}

TEST_CASE("fused gradients in bfloat16 are near those of float32 for odd numbers of samples and in pretraining") {
  for (const Bf16Unit unit : Bf16UnitsHere()) {
    const Bf16Limit limit(unit);
    torch::manual_seed(15);
    for (const FieldStage stage : {FieldStage::kPretrain, FieldStage::kTrain}) {
      for (const int64_t samples : {1, 7, 63, 65}) {
        INFO(NameOf(unit) << ", stage " << static_cast<int>(stage) << ", " << samples << " samples");
        Setting setting = OneRay(samples, /*key_points=*/3);
        setting.stage = stage;
        setting.shade = samples > 7;
        setting.kernel = "bf16";
        const auto field = MakeField(setting);
        REQUIRE(field->Fused()->bf16 == unit);
        RayRenderer renderer = MakeRenderer(*field, setting);
        const RayBatch rays = RayInside();
        const RayObjective objective = ObjectiveFor(setting);
        const RayOptions options = RandomOptions(setting.rays);
        const Found exact = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat64);
        const Found found = Fused(*field, renderer, rays, options, objective);
        CHECK(found.samples == samples);
        CHECK(found.reconstruction == Approx(exact.reconstruction).epsilon(0.1));
        // One unit on the other side of its ReLU changes much of what a single sample gives.
        CHECK(RelativeDifference(Joined(found.gradients), Joined(exact.gradients)) < 0.25);
      }
    }
  }
}
