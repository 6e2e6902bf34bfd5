#include "libeditnerf/training/trainer.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <filesystem>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

double MeanOfLosses(Trainer& trainer, int steps) {
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += trainer.Step().at("reconstruction");
  return sum / steps;
}

}  // namespace

TEST_CASE("the paper's configuration trains on a tiny scene with falling loss") {
  torch::manual_seed(1);
  const Config config = Load("tiny");
  const Run run = MakeRun(config, FieldStage::kTrain, TinyScene(), TrueTracks(TinyScene()), torch::kCPU);
  KeyPointSupervision supervision;
  supervision.flow = torch::zeros({7, 18, 32, 2});
  supervision.depth = TinyScene().truth->depth.slice(0, 0, 8).clone();
  Trainer trainer(run, TinyScene(), supervision, Scratch("paper"));
  const double first = MeanOfLosses(trainer, 20);
  for (int i = 0; i < 160; ++i) trainer.Step();
  const double last = MeanOfLosses(trainer, 20);
  CHECK(std::isfinite(last));
  CHECK(last < 0.7 * first);
}

TEST_CASE("both stages of the fast field train on a tiny scene with falling loss") {
  for (const FieldStage stage : {FieldStage::kPretrain, FieldStage::kTrain}) {
    torch::manual_seed(1);
    const torch::Tensor tracks = stage == FieldStage::kTrain ? TrueTracks(TinyScene()) : torch::Tensor();
    const Run run = MakeRun(SmallFast(), stage, TinyScene(), tracks, torch::kCPU);
    Trainer trainer(run, TinyScene(), std::nullopt, Scratch("fast"));
    const double first = MeanOfLosses(trainer, 10);
    for (int i = 0; i < 60; ++i) trainer.Step();
    CHECK(MeanOfLosses(trainer, 10) < 0.6 * first);
  }
}

TEST_CASE("what stands still is learnt under key points that no frame has") {
  const Scene& scene = TinyScene();
  // The lower corners of every image, where the lid never is.
  DepthTargets still;
  const torch::Tensor frame = torch::arange(8, torch::kInt64);
  still.frame = torch::cat({frame, frame});
  still.pixel = torch::cat(
      {torch::tensor({1, 16}, torch::kInt64).expand({8, 2}), torch::tensor({30, 16}, torch::kInt64).expand({8, 2})});
  const auto truth = scene.truth->depth.index_select(0, torch::tensor(scene.train, torch::kInt64));
  still.distance = torch::cat({truth.select(1, 16).select(1, 1), truth.select(1, 16).select(1, 30)});
  still.tolerance = torch::full({16}, 0.01F);
  still.key_point = torch::full({16}, kStandsStill, torch::kInt64);
  const auto error_elsewhere = [&](double share) {
    torch::manual_seed(1);
    Config config = SmallFast();
    config.train.still_share = share;
    const Run run = MakeRun(config, FieldStage::kTrain, scene, TrueTracks(scene), torch::kCPU);
    Trainer trainer(run, scene, std::nullopt, Scratch("still"));
    trainer.SetKnownPlaces(still);
    for (int i = 0; i < 400; ++i) CHECK(std::isfinite(trainer.Step().at("reconstruction")));
    const torch::NoGradGuard no_grad;
    TrainingRays sampler(scene, scene.train, torch::kCPU);
    sampler.SetKnownPlaces(still, 0.75, 0);
    const RayTargets rays = sampler.Sample(200);
    FrameStates states = run.field->States(torch::zeros({200}, torch::kInt64));
    const torch::Tensor a = run.field->States(torch::randint(8, {200}, torch::kInt64)).key_points;
    states.key_points = torch::lerp(states.key_points, a, 0.5);
    RayOptions options;
    options.start = rays.start;
    const RayResult seen = run.renderer->Render(
        *run.field, {rays.rays.origin, rays.rays.direction, torch::arange(200, torch::kInt64)}, states, options);
    return (seen.rgb - rays.target).slice(0, 200 - rays.drawn).square().mean().item<double>();
  };
  CHECK(error_elsewhere(0.5) < 0.8 * error_elsewhere(0));
}

TEST_CASE("what a part shows is learnt where it was at other times") {
  const Scene scene = SmallScene("cups", 10, 48);
  const torch::Tensor train = torch::tensor(scene.train, torch::kInt64);
  const torch::Tensor tracks = scene.truth->scene_from_object.index_select(0, train).slice(2, 0, 3).select(3, 3).to(
      torch::kFloat32);  // [T, 2, 3], the cups' own origins
  // Where the first cup is seen.
  const torch::Tensor at = (scene.truth->mask.index_select(0, train) == 1).nonzero();  // frame, row, column
  const torch::Tensor depth = scene.truth->depth.index_select(0, train);
  DepthTargets places;
  places.frame = at.select(1, 0);
  places.pixel = torch::stack({at.select(1, 2), at.select(1, 1)}, 1);
  places.distance = depth.index({at.select(1, 0), at.select(1, 1), at.select(1, 2)}).to(torch::kFloat32);
  places.tolerance = torch::full({at.size(0)}, 0.01F);
  places.key_point = torch::zeros({at.size(0)}, torch::kInt64);
  const auto error_elsewhere = [&](double share) {
    torch::manual_seed(1);
    Config config = SmallFast();
    config.train.carried_share = share;
    config.train.still_share = 0;
    const Run run = MakeRun(config, FieldStage::kTrain, scene, tracks, torch::kCPU);
    Trainer trainer(run, scene, std::nullopt, Scratch("carried"));
    trainer.SetKnownPlaces(places);
    for (int i = 0; i < 800; ++i) CHECK(std::isfinite(trainer.Step().at("reconstruction")));
    const torch::NoGradGuard no_grad;
    TrainingRays sampler(scene, scene.train, torch::kCPU);
    sampler.SetKnownPlaces(places, 0, 0.75);
    RayTargets rays = sampler.Sample(400);
    const int64_t first = 400 - rays.drawn;
    FrameStates states = run.field->States(rays.frame);
    const torch::Tensor elsewhere = run.field->States(torch::randint(10, {400}, torch::kInt64)).key_points;
    const torch::Tensor shift = elsewhere.select(1, 0) - states.key_points.select(1, 0);
    states.key_points = torch::stack({elsewhere.select(1, 0), elsewhere.flip(0).select(1, 1)}, 1);
    RayOptions from_there;
    from_there.start = rays.start;
    const RayResult seen = run.renderer->Render(
        *run.field, {rays.rays.origin + shift, rays.rays.direction, torch::arange(400, torch::kInt64)}, states,
        from_there);
    return (seen.rgb - rays.target).slice(0, first).square().mean().item<double>();
  };
  CHECK(error_elsewhere(0.3) < 0.8 * error_elsewhere(0));
}

TEST_CASE("a run whose part turns comes back with its local frames") {
  const Scene& scene = TinyScene();
  torch::manual_seed(1);
  const torch::Tensor turns = torch::rand({8, 1, 3});
  Config config = SmallFast();
  const Run run = MakeRun(config, FieldStage::kTrain, scene, TrueTracks(scene), torch::kCPU, turns);
  REQUIRE(run.field->has_local_frames());
  const torch::Tensor before = run.field->LocalFramesOf(TrueTracks(scene)).detach();
  const fs::path folder = Scratch("turning");
  Trainer trainer(run, scene, std::nullopt, folder);
  const double first = MeanOfLosses(trainer, 10);
  for (int i = 0; i < 60; ++i) trainer.Step();
  CHECK(MeanOfLosses(trainer, 10) < 0.6 * first);
  const torch::Tensor after = run.field->LocalFramesOf(TrueTracks(scene)).detach();
  CHECK(!torch::equal(before, after));  // they are learnt
  SaveRun(run, folder);
  const Run back = LoadRun(folder);
  REQUIRE(back.field->has_local_frames());
  CHECK(torch::equal(back.field->LocalFramesOf(TrueTracks(scene)), after));
  config.field.fast.local_frames = Choice::kOff;
  CHECK(!MakeRun(config, FieldStage::kTrain, scene, TrueTracks(scene), torch::kCPU, turns).field->has_local_frames());
  fs::remove_all(folder);
}

TEST_CASE("a step with a loss that is not finite changes no weight") {
  torch::manual_seed(1);
  const Run run = MakeRun(SmallFast(), FieldStage::kTrain, TinyScene(), TrueTracks(TinyScene()), torch::kCPU);
  Trainer trainer(run, TinyScene(), std::nullopt, Scratch("guard"));
  trainer.Step();
  const auto parameters = run.field->named_parameters();
  {
    const torch::NoGradGuard no_grad;
    parameters["fine.color_network.output.bias"].fill_(std::nan(""));
  }
  const torch::Tensor before = parameters["fine.canonical_table"].detach().clone();
  trainer.Step();
  CHECK(torch::equal(before, parameters["fine.canonical_table"].detach()));
}

TEST_CASE("a run of the bfloat16 kernel is shown where the processor has none, and trained only where it has") {
  const fs::path folder = Scratch("bf16");
  Run run = MakeRun(SmallFast(), FieldStage::kTrain, TinyScene(), TrueTracks(TinyScene()), torch::kCPU);
  run.config.field.fast.kernel = "bf16";
  SaveRun(run, folder);
  {
    const Bf16Limit none(Bf16Unit::kNone);
    std::string said;
    const LogLevel level = GetLogLevel();
    SetLogLevel(LogLevel::kInfo);
    SetLogSink([&](LogLevel, const std::string& line) { said += line; });
    const Run shown = LoadRun(folder);
    SetLogSink({});
    SetLogLevel(level);
    CHECK_THAT(said, HasText("which this processor has not; it is shown with fp32"));
    REQUIRE(shown.field->Fused());
    CHECK(shown.field->Fused()->bf16 == Bf16Unit::kNone);
    CHECK_THROWS_AS(LoadRunWithExtra(folder, torch::kCPU).run.field->Fused(), ConfigError);
  }
  if (FastestBf16() != Bf16Unit::kNone) CHECK(LoadRun(folder).field->Fused()->bf16 == FastestBf16());
  fs::remove_all(folder);
}
