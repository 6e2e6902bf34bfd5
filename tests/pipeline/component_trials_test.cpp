#include "libeditnerf/pipeline/component_trials.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <nlohmann/json.hpp>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/scene/timeline.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"
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

// The lid's corner twice, and a key point of nothing that moves with it.
DetectedKeyPoints TwoOnTheLid(const Scene& scene) {
  const torch::Tensor lid = TrueTracks(scene);
  const auto frames = lid.size(0);
  const torch::Tensor other =
      torch::stack(
          {torch::linspace(0, 1, frames).sin().pow(2), torch::zeros({frames}), torch::linspace(0, 9, frames).cos()}, 1)
          .to(lid.dtype())
          .unsqueeze(1);
  DetectedKeyPoints detected;
  detected.tracks = torch::cat({lid, other, lid + 0.01}, 1);
  detected.part_depth.frame = torch::zeros({4}, torch::kInt64);
  detected.part_depth.pixel = torch::full({4, 2}, 5, torch::kInt64);
  detected.part_depth.distance = torch::full({4}, 1.0F);
  detected.part_depth.tolerance = torch::full({4}, 0.1F);
  detected.part_depth.key_point = torch::tensor({0, 1, 2, static_cast<int>(kNotCarried)}, torch::kInt64);
  return detected;
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
  CHECK(appearance.on == (*appearance.with - *appearance.without > 0.4));

  const ComponentTrials again = DecideComponents(scene, Request(config), detected);
  CHECK(ToJson(again) == ToJson(trials));
  CHECK(ToJson(trials).at("field.use_appearance").at("with") == *appearance.with);
}

TEST_CASE("local frames are judged where a part is seen that turns") {
  const Scene& scene = TinyScene();
  DetectedKeyPoints detected;
  detected.tracks = TrueTracks(scene);
  detected.turns = torch::zeros_like(detected.tracks);
  detected.part_depth = TwoOnTheLid(scene).part_depth;
  detected.part_depth.key_point.zero_();
  detected.part_depth.frame.fill_(LocateInTime(scene, scene.val[0]).before);
  Config config = AllOpen(5);
  config.field.use_view_direction = Choice::kOff;
  const auto trials = [&] { return DecideComponents(scene, Request(config), detected); };
  const ComponentTrials on_parts = trials();
  const ComponentTrial& frames = Of(on_parts, "field.fast.local_frames");
  REQUIRE(frames.with.has_value());
  CHECK_THAT(frames.reason, HasText("where parts are seen"));
  CHECK(frames.on == (*frames.with - *frames.without > -0.3));
  // The same trainings, other pixels.
  const ComponentTrial& appearance = Of(on_parts, "field.use_appearance");
  CHECK(*appearance.without != (frames.on ? *frames.with : *frames.without));
  detected.part_depth.key_point.fill_(kNotCarried);
  CHECK(*Of(trials(), "field.fast.local_frames").without != *frames.without);
}

TEST_CASE("appearance codes are there where the light changes, and nowhere else") {
  const Config config = AllOpen(120);
  const Scene still = SmallScene("static", 8, 32), brightening = Brightening();
  const auto codes = [&](const Scene& scene) {
    return Of(DecideComponents(scene, Request(config), NoKeyPoints(scene)), "field.use_appearance");
  };
  CHECK_FALSE(codes(still).on);
  const ComponentTrial needed = codes(brightening);
  CHECK(needed.on);
  CHECK_THAT(needed.reason, HasText("the mean of two seeds"));
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

TEST_CASE("a key point that moves as another one does goes where held-out pixels do not miss it") {
  const Scene& scene = TinyScene();
  const DetectedKeyPoints detected = TwoOnTheLid(scene);
  Config config = SmallFast();
  config.train.trial_steps = 20;
  config.train.merge_key_points = Choice::kOff;
  CHECK(DecideComponents(scene, Request(config), detected).merged == KeyPointMap{0, 1, 2});

  config.train.merge_key_points = Choice::kOn;
  const ComponentTrials forced = DecideComponents(scene, Request(config), detected);
  CHECK(forced.merged == KeyPointMap{0, 1, 0});
  CHECK_FALSE(Of(forced, "key point 3").with.has_value());

  config.train.merge_key_points = Choice::kAuto;
  const ComponentTrials tried = DecideComponents(scene, Request(config), detected);
  const ComponentTrial& third = Of(tried, "key point 3");
  REQUIRE(third.with.has_value());
  CHECK(third.on == (*third.with - *third.without > 0.2));
  CHECK(tried.merged == (third.on ? KeyPointMap{0, 1, 2} : KeyPointMap{0, 1, 0}));
  CHECK_THAT(third.reason, HasText("moves as key point 1 does"));

  const ScratchFolder scratch;
  const std::filesystem::path file = scratch.path() / "components.json";
  CHECK(ReadMerged(file, 3) == KeyPointMap{0, 1, 2});
  WriteJson(file, ToJson(forced));
  CHECK(ReadMerged(file, 3) == forced.merged);
  WriteJson(file, {{"key point 2", {{"merged_into", 2}}}});
  CHECK_THROWS_WITH(ReadMerged(file, 3), HasText("components.json: key point 2: merged_into"));
}

TEST_CASE("what a merged key point carried, the other one carries") {
  const DetectedKeyPoints detected = TwoOnTheLid(TinyScene());
  const DetectedKeyPoints merged = Merged(detected, {0, 1, 0});
  CHECK(torch::equal(merged.tracks, detected.tracks.slice(1, 0, 2)));
  CHECK(torch::equal(merged.part_depth.key_point,
                     torch::tensor({0, 1, 0, static_cast<int>(kNotCarried)}, torch::kInt64)));
  CHECK(detected.part_depth.key_point[2].item<int64_t>() == 2);
  CHECK(WithMerged({0, 1, 2, 3}, 0, 2) == KeyPointMap{0, 1, 0, 2});
  CHECK_THROWS_AS(Merged(detected, {0, 2, 0}), ConfigError);
  CHECK_THROWS_AS(Merged(detected, {0, 1}), ConfigError);
}

TEST_CASE("pretraining has as many ambient coordinates as held-out pixels gain by") {
  const Scene& scene = TinyScene();
  Config config = SmallFast();
  const ComponentTrials fixed = DecideAmbient(scene, Request(config), {});
  CHECK(fixed.trials.empty());
  CHECK(fixed.config.field.slicing.ambient_dim == config.field.slicing.ambient_dim);

  config.field.slicing.ambient_dim = 0;
  config.pretrain.trial_steps = 5;
  const ComponentTrials tried = DecideAmbient(scene, Request(config), {});
  REQUIRE(!tried.trials.empty());
  int64_t expected = 1;
  for (const ComponentTrial& trial : tried.trials) {
    CHECK(trial.on == (*trial.with - *trial.without > 0.2));
    expected += trial.on ? 1 : 0;
  }
  CHECK(tried.config.field.slicing.ambient_dim == expected);

  config.pretrain.trial_steps = 0;
  const ComponentTrials none = DecideAmbient(scene, Request(config), {});
  CHECK(none.config.field.slicing.ambient_dim == 3);
  CHECK_THAT(none.trials.at(0).reason, HasText("pretrain.trial_steps is 0"));
}
