// What is not finite never reaches the weights, and a run that fails again and again ends.
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/training/good_state.h"
#include "libeditnerf/training/step_replay.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Run TinyRun(const Config& config, FieldStage stage = FieldStage::kTrain) {
  torch::manual_seed(1);
  return MakeRun(config, stage, TinyScene(), stage == FieldStage::kTrain ? TrueTracks(TinyScene()) : torch::Tensor(),
                 torch::kCPU);
}

void Spoil(const torch::Tensor& tensor, float value) {
  const torch::NoGradGuard no_grad;
  tensor.view({-1})[0] = value;
}

// Of the hyperspace network: whatever is added everywhere, no sample can avoid.
std::vector<std::string> BiasesOf(const Run& run) {
  std::vector<std::string> names;
  for (const auto& item : run.field->named_parameters()) {
    const std::string& name = item.key();
    if (name.rfind("fine.", 0) == 0 && name.find("bias") != std::string::npos) names.push_back(name);
  }
  return names;
}

std::map<std::string, torch::Tensor> Copies(const Run& run) {
  std::map<std::string, torch::Tensor> copies;
  for (const auto& item : run.field->named_parameters()) copies["field." + item.key()] = item.value().detach().clone();
  for (const auto& item : run.renderer->named_buffers()) copies["renderer." + item.key()] = item.value().clone();
  return copies;
}

}  // namespace

TEST_CASE("a NaN in any layer that every sample passes is met by the guard, on every way through the field") {
  for (const auto& [way, config] : FieldWays(/*modules=*/true)) {
    for (const FieldStage stage : {FieldStage::kPretrain, FieldStage::kTrain}) {
      const CaughtLog log;
      const std::vector<std::string> biases = BiasesOf(TinyRun(config, stage));
      REQUIRE(biases.size() >= 4);
      for (const std::string& name : biases) {
        INFO(way << " " << name);
        const Run run = TinyRun(config, stage);
        Trainer trainer(run, TinyScene(), std::nullopt, Scratch("nan"));
        trainer.Step();
        {
          const torch::NoGradGuard no_grad;
          run.field->named_parameters()[name].fill_(kNan);
        }
        const auto before = Copies(run);
        for (int i = 0; i < 3; ++i) trainer.Step();
        CHECK(trainer.run().counters.skipped == 3);
        CHECK_FALSE(trainer.run().counters.not_finite.empty());
        for (const auto& item : run.field->named_parameters()) {
          const torch::Tensor now = item.value().detach();
          CHECK(torch::allclose(now, before.at("field." + item.key()), 0, 0, /*equal_nan=*/true));
        }
      }
    }
  }
}

TEST_CASE("where density is not a number the occupancy grid does not hide it") {
  const CaughtLog log;
  Config config = SmallFast();
  config.render.occupancy_update_every = 1;
  const Run run = TinyRun(config);
  Trainer trainer(run, TinyScene(), std::nullopt, Scratch("dense"));
  for (int i = 0; i < 6; ++i) trainer.Step();
  {
    const torch::NoGradGuard no_grad;
    run.field->named_parameters()["fine.density_network.output.bias"].fill_(kNan);
  }
  for (int i = 0; i < 9; ++i) trainer.Step();
  CHECK(trainer.run().counters.skipped == 9);
}

TEST_CASE("after repeated failure weights, moments and occupancy are those of the good state, and training goes on") {
  for (const auto& [way, config] : FieldWays(/*modules=*/true)) {
    INFO(way);
    const CaughtLog log;
    const Run run = TinyRun(config);
    Trainer trainer(run, TinyScene(), std::nullopt, Scratch("back"));
    trainer.Step();  // the first step's weights are the good state
    std::map<std::string, torch::Tensor> good;
    {
      const Run untouched = TinyRun(config);
      good = Copies(untouched);
    }
    for (int i = 0; i < 3; ++i) trainer.Step();
    {
      const torch::NoGradGuard no_grad;
      run.field->named_parameters()[way == "paper" ? "fine.density.bias" : "fine.density_network.output.bias"].fill_(
          kNan);
      for (const auto& item : run.renderer->named_buffers()) {
        if (item.key().find("density") != std::string::npos) item.value().fill_(7);
      }
    }
    for (int i = 0; i < 10; ++i) trainer.Step();
    CHECK(trainer.run().counters.rolled_back == 1);
    for (const auto& [name, now] : Copies(run)) {
      INFO(name);
      if (name.rfind("field.", 0) == 0) CHECK(torch::equal(now, good.at(name)));
      if (name.find("density") != std::string::npos) CHECK(now.ne(7).all().item<bool>());
    }
    CHECK_THAT(log.text(), HasText("going back to weights, optimiser and occupancy of step 0"));
    // Derived copies (bfloat16 tables) are those of the restored weights too.
    const double loss = trainer.Step().at("reconstruction");
    CHECK(std::isfinite(loss));
    CHECK(trainer.run().counters.skipped == 10);
    CHECK(SkippedText(trainer.run().counters).find("10 of 15 steps were skipped") == 0);
  }
}

TEST_CASE("going back takes the optimiser's moments along") {
  const Run run = TinyRun(SmallFast());
  Adam adam({{run.field->named_parameters().pairs(), 1, false}}, AdamOptions());
  const auto step = [&](double gradient) {
    for (const auto& item : run.field->named_parameters()) {
      item.value().mutable_grad() = torch::full_like(item.value(), gradient);
    }
    adam.Step(1e-3);
  };
  step(1);
  GoodState good;
  good.Keep(run, adam);
  std::map<std::string, torch::Tensor> kept;
  for (const auto& [name, tensor] : adam.State()) kept[name] = tensor.clone();
  const auto weights = Copies(run);
  const torch::Tensor table = run.field->named_parameters()["fine.canonical_table"];
  step(kNan);
  REQUIRE_FALSE(HasFiniteWeights(*run.field));
  const auto version = table._version();
  Run again = run;
  good.Restore(&again, &adam);
  CHECK(table._version() != version);  // or a copy in bfloat16 would stay what it was
  CHECK(HasFiniteWeights(*run.field));
  for (const auto& [name, tensor] : adam.State()) CHECK(torch::equal(tensor, kept.at(name)));
  for (const auto& [name, tensor] : Copies(run)) CHECK(torch::equal(tensor, weights.at(name)));
}

TEST_CASE("a run that fails again after going back ends with an error that says what to do") {
  const CaughtLog log;
  const Run run = TinyRun(SmallFast());
  Trainer trainer(run, TinyScene(), std::nullopt, Scratch("again"));
  trainer.Step();
  const auto spoil = [&] {
    const torch::NoGradGuard no_grad;
    run.field->named_parameters()["fine.color_network.output.bias"].fill_(kNan);
  };
  spoil();
  for (int i = 0; i < 10; ++i) trainer.Step();
  trainer.Step();
  spoil();
  for (int i = 0; i < 9; ++i) trainer.Step();
  CHECK_THROWS_WITH(trainer.Step(), HasText("training diverges: at step 21, after going back to the state of step 0") &&
                                        HasText("reconstruction") && HasText("lower train.learning_rate"));
}

TEST_CASE("a run that cannot take its first step ends with an error") {
  const CaughtLog log;
  const Run run = TinyRun(SmallFast());
  Spoil(run.field->named_parameters()["fine.color_network.output.bias"], kNan);
  Trainer trainer(run, TinyScene(), std::nullopt, Scratch("first"));
  for (int i = 0; i < 9; ++i) trainer.Step();
  CHECK_THROWS_WITH(trainer.Step(), HasText("training fails from its first step on"));
}

TEST_CASE("a skipped step is written down and gives the same numbers when it is computed again") {
  for (const auto& [way, config] : FieldWays(/*modules=*/true)) {
    INFO(way);
    const CaughtLog log;
    const TrainingFolder folder("dump");
    Config dumping = config;
    dumping.train.dump_bad_steps = true;
    const Run run = TinyRun(dumping);
    Trainer trainer(run, TinyScene(), SupervisionOf(TinyScene()), folder.path());
    for (int i = 0; i < 3; ++i) trainer.Step();
    const std::string spoilt = BiasesOf(run).front();
    Spoil(run.field->named_parameters()[spoilt], kNan);
    const auto losses = trainer.Step();
    trainer.Step();  // only the first of a row is written
    CHECK(fs::exists(folder.path() / "bad_steps" / "000003" / "checkpoint.safetensors"));
    CHECK_FALSE(fs::exists(folder.path() / "bad_steps" / "000004"));
    const StepReplay replay = ReplayStep(folder.path() / "bad_steps" / "000003", torch::kCPU);
    CHECK(replay.step == 3);
    CHECK(replay.weights == std::vector<std::string>{spoilt});
    REQUIRE(replay.verdict.losses.size() == losses.size());
    for (const auto& [name, value] : replay.verdict.losses) {
      INFO(name << " " << value << " " << losses.at(name));
      CHECK((value == losses.at(name) || (std::isnan(value) && std::isnan(losses.at(name)))));
    }
    CHECK_FALSE(replay.verdict.take);
    CHECK_THAT(ToText(replay), HasText("not finite before the step: " + spoilt + "\n"));
  }
}

TEST_CASE("steps are only written down where that was asked for, and a folder without one is refused") {
  const CaughtLog log;
  const TrainingFolder folder("no_dump");
  const Run run = TinyRun(SmallFast());
  Trainer trainer(run, TinyScene(), std::nullopt, folder.path());
  Spoil(run.field->named_parameters()["fine.color_network.output.bias"], kNan);
  trainer.Step();
  CHECK_FALSE(fs::exists(folder.path() / "bad_steps"));
  SaveRun(TinyRun(SmallFast()), folder.path());
  CHECK_THROWS_WITH(ReplayStep(folder.path(), torch::kCPU), HasText("no step of training lies here"));
}
