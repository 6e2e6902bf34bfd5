// Whole runs over input that nobody should film: they end with finite weights and a report of what was skipped, or with
// an error that says what is wrong.
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/training/good_state.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

struct Ended {
  std::string error;  // empty where the run went through
  RunCounters counters;
  double psnr = 0;
};

struct Input {
  Scene scene = TinyScene();
  torch::Tensor tracks = TrueTracks(TinyScene());
  KeyPointSupervision supervision = SupervisionOf(TinyScene());
};

// Trains, and checks what has to hold of every run: the checkpoint loads (which asks for finite weights), and a run
// that skipped steps says so.
Ended Train(const Input& input, Config config, FieldStage stage) {
  const TrainingFolder folder("whole_run");
  Ended ended;
  for (StageConfig* one : {&config.pretrain, &config.train}) {
    one->evaluate_every = 40;
    one->steps = 40;
  }
  const CaughtLog log;
  try {
    torch::manual_seed(1);
    const bool train = stage == FieldStage::kTrain;
    const Run run = MakeRun(config, stage, input.scene, train ? input.tracks : torch::Tensor(), torch::kCPU);
    Trainer trainer(run, input.scene, train ? std::optional(input.supervision) : std::nullopt, folder.path());
    trainer.Train();
  } catch (const Error& error) {
    ended.error = error.what();
  }
  if (!ended.error.empty()) return ended;
  const Run run = LoadRun(folder.path());
  CHECK(HasFiniteWeights(*run.field));
  CHECK(run.counters.step == 40);
  ended.counters = run.counters;
  const std::vector<MetricsRow> rows = ReadMetricsLog(folder.path() / "metrics.csv");
  REQUIRE_FALSE(rows.empty());
  ended.psnr = rows.back().held_out_psnr.value_or(std::nan(""));
  CHECK((log.text().find("steps were skipped") != std::string::npos) == (run.counters.skipped > 0));
  return ended;
}

// Input on which every stage of every field has to get through, without skipping a single step.
void CheckGetsThrough(const Input& input) {
  for (const auto& [way, config] : FieldWays(/*modules=*/false)) {
    for (const FieldStage stage : {FieldStage::kPretrain, FieldStage::kTrain}) {
      if (way == "paper" && stage == FieldStage::kPretrain) continue;  // seconds; it differs by the slicing alone
      INFO(way << (stage == FieldStage::kTrain ? ", training" : ", pretraining"));
      const Ended ended = Train(input, config, stage);
      CHECK(ended.error.empty());
      CHECK(ended.counters.skipped == 0);
      CHECK(std::isfinite(ended.psnr));
    }
  }
}

}  // namespace

TEST_CASE("absurd learning rates end in finite weights or in an error that names the rate", "[whole-run]") {
  for (const auto& [way, base] : FieldWays(/*modules=*/false)) {
    for (const double rate : {1.0, 1e3, 1e12, 1e30, 1e38}) {
      INFO(way << " " << rate);
      Config config = base;
      config.train.learning_rate = config.train.final_learning_rate = rate;
      const Ended ended = Train({}, config, FieldStage::kTrain);
      if (ended.error.empty()) continue;
      CHECK_THAT(ended.error, HasText("not finite: ") && HasText("lower train.learning_rate (now "));
    }
  }
}

TEST_CASE("a frame of pure white is trained on", "[whole-run]") {
  Input input;
  input.scene.images = input.scene.images.clone();
  input.scene.images[input.scene.train[3]].fill_(255);
  CheckGetsThrough(input);
}

TEST_CASE("images that are black throughout are trained on", "[whole-run]") {
  Input input;
  input.scene.images = torch::zeros_like(input.scene.images);
  CheckGetsThrough(input);
}

TEST_CASE("duplicated frames are trained on", "[whole-run]") {
  Input input;
  input.scene.images = input.scene.images.clone();
  for (const size_t row : {1, 2, 5}) {
    const auto from = static_cast<size_t>(input.scene.train[row]), to = static_cast<size_t>(input.scene.train[row + 1]);
    input.scene.images[static_cast<int64_t>(to)].copy_(input.scene.images[static_cast<int64_t>(from)]);
    input.scene.frames[to].camera = input.scene.frames[from].camera;
    input.tracks[static_cast<int64_t>(row + 1)].copy_(input.tracks[static_cast<int64_t>(row)]);
  }
  CheckGetsThrough(input);
}

TEST_CASE("a camera that stays where it is is trained on", "[whole-run]") {
  Input input;
  const Camera camera = input.scene.frames[static_cast<size_t>(input.scene.train[0])].camera;
  for (const int64_t frame : input.scene.train) input.scene.frames[static_cast<size_t>(frame)].camera = camera;
  CheckGetsThrough(input);
}

TEST_CASE("poses that are far off are trained on", "[whole-run]") {
  Input input;
  // Every frame takes the camera of another one.
  for (size_t row = 0; row < input.scene.train.size(); ++row) {
    const auto other = static_cast<size_t>(input.scene.train[(3 * row + 2) % input.scene.train.size()]);
    input.scene.frames[static_cast<size_t>(input.scene.train[row])].camera = TinyScene().frames[other].camera;
  }
  CheckGetsThrough(input);
}

TEST_CASE("flow of the wrong sign, and flow and depth that are known nowhere, are trained on", "[whole-run]") {
  Input input;
  input.supervision.flow = torch::full_like(input.supervision.flow, -40);
  CheckGetsThrough(input);
  input.supervision.flow.fill_(std::nan(""));
  input.supervision.depth.fill_(std::nan(""));
  CheckGetsThrough(input);
}

TEST_CASE("eight key points on one part, all in the same place, are trained on", "[whole-run]") {
  Input input;
  input.tracks = input.tracks.repeat({1, 8, 1});
  CheckGetsThrough(input);
}

TEST_CASE("key points that never move are trained on", "[whole-run]") {
  Input input;
  input.scene = SmallScene("static", 8, 32);
  input.tracks = torch::tensor({0.1F, 0.0F, 0.1F}).expand({8, 1, 3}).clone();
  input.supervision = SupervisionOf(input.scene);
  CheckGetsThrough(input);
}
