#include "libeditnerf/benchmarks/ablation_ladder.h"

#include <torch/types.h>

#include "libeditnerf/config/yaml.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

DetectedKeyPoints Detected(bool turning) {
  DetectedKeyPoints detected;
  detected.tracks = torch::rand({6, 2, 3});
  if (turning) detected.turns = torch::rand({6, 2, 3});
  return detected;
}

}  // namespace

TEST_CASE("every step of the ablation adds one thing, and the last is the configuration as it is") {
  Config config;
  config.train.still_share = config.train.carried_share = 0.2;
  config.train.lambda_depth = 0.1;
  const LadderKeyPoints volume = {Detected(true), torch::rand({2, 3})};
  const DetectedKeyPoints refined = Detected(true);
  const std::vector<LadderStep> steps = AblationLadder(config, volume, refined);
  std::vector<std::string> names;
  for (const LadderStep& step : steps) names.push_back(step.name);
  REQUIRE(names ==
          std::vector<std::string>{"base", "motion", "geometry", "initialisation", "refinement", "local-frames"});
  CHECK(steps[0].config.train.lambda_motion == 0);
  CHECK(steps[1].config.train.lambda_motion == 1e-4);
  CHECK(steps[1].config.train.lambda_geometry == 0);
  CHECK(steps[2].config.train.lambda_geometry == 0.5);
  for (size_t i = 0; i < 3; ++i) {  // the same place in every frame
    CHECK(torch::equal(steps[i].detected.tracks, volume.reference.expand({6, 2, 3})));
  }
  CHECK(torch::equal(steps[3].detected.tracks, volume.detected.tracks));
  for (size_t i = 0; i < 4; ++i) {
    CHECK(steps[i].from_volume);
    CHECK(steps[i].config.train.still_share + steps[i].config.train.carried_share == 0);
    CHECK(steps[i].config.train.lambda_depth == 0);
    CHECK_FALSE(steps[i].detected.turns.defined());
  }
  CHECK(torch::equal(steps[4].detected.tracks, refined.tracks));
  CHECK_FALSE(steps[4].detected.turns.defined());
  CHECK(steps[4].config.train.carried_share == 0);
  CHECK(ToYaml(steps[5].config) == ToYaml(config));
  CHECK(steps[5].detected.turns.defined());

  const LadderStep last = AblationLadder(config, volume, Detected(false)).back();  // nothing turns
  CHECK(last.name == "places");
  CHECK(ToYaml(last.config) == ToYaml(config));
}

TEST_CASE("the paper's detection takes maxima of the volume as they are") {
  const DetectionConfig plain = VolumeDetection(DetectionConfig(), 3);
  CHECK_FALSE(plain.rigid_parts);
  CHECK_FALSE(plain.refine);
  CHECK(plain.count == 3);
}
