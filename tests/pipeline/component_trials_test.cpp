#include "libeditnerf/pipeline/component_trials.h"

#include <torch/torch.h>

#include <nlohmann/json.hpp>

#include "libeditnerf/scene/timeline.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

Config AllOpen(int64_t trial_steps) {
  Config config = SmallFast();
  config.field.use_view_direction = config.field.use_appearance = config.field.fast.local_frames = Choice::kAuto;
  config.train.trial_steps = trial_steps;
  return config;
}

StageRequest Request(const Config& config) {
  StageRequest request;
  request.config = config;
  return request;
}

DetectedKeyPoints NoKeyPoints(const Scene& scene) {
  DetectedKeyPoints detected;
  detected.tracks = torch::zeros({static_cast<int64_t>(scene.train.size()), 0, 3});
  return detected;
}

const ComponentTrial& Of(const ComponentTrials& trials, const std::string& setting) {
  for (const ComponentTrial& trial : trials.trials) {
    if (trial.setting == setting) return trial;
  }
  FAIL("not tried: " << setting);
  return trials.trials.front();
}

// The light goes up as time passes, to five times what it was.
Scene Brightening() {
  Scene scene = SmallScene("static", 8, 32);
  scene.images = scene.images.to(torch::kFloat32);
  for (int64_t i = 0; i < static_cast<int64_t>(scene.frames.size()); ++i) {
    const TimelinePosition at = LocateInTime(scene, i);
    const double time = (static_cast<double>(at.before) + at.weight) / 7;
    scene.images[i] *= 0.2 + 0.8 * time;
  }
  scene.images = scene.images.to(torch::kUInt8);
  return scene;
}

}  // namespace

TEST_CASE("what a scene needs of the field is tried, and what is forced is not") {
  const Scene& scene = TinyScene();
  DetectedKeyPoints detected;
  detected.tracks = TrueTracks(scene);
  Config config = AllOpen(5);
  config.field.use_view_direction = Choice::kOff;

  torch::manual_seed(7);
  const torch::Tensor expected = torch::rand({4});
  torch::manual_seed(7);
  const ComponentTrials trials = DecideComponents(scene, Request(config), detected);
  CHECK(torch::equal(torch::rand({4}), expected));

  REQUIRE(trials.trials.size() == 2);
  CHECK(trials.config.field.use_view_direction == Choice::kOff);
  CHECK(trials.config.field.fast.local_frames == Choice::kOff);
  CHECK(Of(trials, "field.fast.local_frames").reason == "no part turns");
  const ComponentTrial& appearance = Of(trials, "field.use_appearance");
  REQUIRE(appearance.with.has_value());
  CHECK(trials.config.field.use_appearance == (appearance.on ? Choice::kOn : Choice::kOff));
  CHECK(appearance.on == (*appearance.with - *appearance.without > 0.2));

  const ComponentTrials again = DecideComponents(scene, Request(config), detected);
  CHECK(ToJson(again) == ToJson(trials));
  CHECK(ToJson(trials).at("field.use_appearance").at("with") == *appearance.with);
}

TEST_CASE("appearance codes are there where the light changes, and nowhere else") {
  const Config config = AllOpen(120);
  const Scene still = SmallScene("static", 8, 32), brightening = Brightening();
  const auto needs = [&](const Scene& scene) {
    return Of(DecideComponents(scene, Request(config), NoKeyPoints(scene)), "field.use_appearance").on;
  };
  CHECK_FALSE(needs(still));
  CHECK(needs(brightening));
}

TEST_CASE("components are as they are while undecided where trials cannot be made, or cost too much") {
  const auto check = [](const ComponentTrials& trials, const std::string& reason) {
    CHECK(trials.config.field.use_view_direction == Choice::kOn);
    CHECK(trials.config.field.use_appearance == Choice::kOff);
    const ComponentTrial& trial = Of(trials, "field.use_view_direction");
    CHECK_FALSE(trial.with.has_value());
    CHECK_THAT(trial.reason, HasText(reason));
  };
  Scene scene = TinyScene();
  const DetectedKeyPoints none = NoKeyPoints(scene);
  check(DecideComponents(scene, Request(AllOpen(0)), none), "train.trial_steps is 0");
  Config short_stage = AllOpen(5);
  short_stage.train.seconds = 1e-3;
  check(DecideComponents(scene, Request(short_stage), none), "of the training time");
  scene.val.clear();
  check(DecideComponents(scene, Request(AllOpen(5)), none), "no validation frames");
}
