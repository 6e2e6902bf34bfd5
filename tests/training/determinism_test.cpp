// The same seed, threads and machine give the same bits; a resumed run continues with them; other numbers of threads
// give nearly the same.
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

using Tensors = std::map<std::string, torch::Tensor>;

constexpr int64_t kSteps = 20, kInterrupted = 9;

struct Case {
  std::string name;
  Config config;
  FieldStage stage;
};

std::vector<Case> AllCases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string& name, Config config) {
    for (StageConfig* stage : {&config.pretrain, &config.train}) stage->steps = kSteps;
    config.render.occupancy_update_every = 4;
    cases.push_back({name + ", pretraining", config, FieldStage::kPretrain});
    cases.push_back({name + ", training", config, FieldStage::kTrain});
  };
  for (const char* kernel : {"fp32", "bf16", "modules"}) {
    if (std::string(kernel) == "bf16" && FastestBf16() == Bf16Unit::kNone) continue;
    Config config = SmallFast();
    config.field.fast.kernel = kernel;
    add(kernel, config);
  }
  Config warped = SmallFast();
  warped.field.warp.enabled = Choice::kOn;
  add("warped", warped);
  add("paper", Load("tiny"));
  return cases;
}

// A run from its first step to its last, interrupted after `interrupt_at` steps and taken up again unless that is 0:
// everything that its checkpoint holds.
Tensors Trained(const Case& c, int64_t interrupt_at = 0) {
  const TrainingFolder folder("bits");
  const Scene& scene = TinyScene();
  const bool train = c.stage == FieldStage::kTrain;
  torch::manual_seed(5);
  const torch::Tensor turns = torch::rand({static_cast<int64_t>(scene.train.size()), 1, 3});
  Run run = MakeRun(c.config, c.stage, scene, train ? TrueTracks(scene) : torch::Tensor(), torch::kCPU,
                    train ? turns : torch::Tensor());
  const auto supervision = train ? std::optional(SupervisionOf(scene)) : std::nullopt;
  if (interrupt_at > 0) {
    Trainer trainer(run, scene, supervision, folder.path());
    for (int64_t i = 1; i < interrupt_at; ++i) trainer.Step();
    RequestInterrupt();
    CHECK_THROWS_AS(trainer.Train(), Interrupted);  // takes one step, then writes the checkpoint
    ClearInterrupt();
    torch::manual_seed(77);  // another process would begin so
    LoadedRun loaded = LoadRunWithExtra(folder.path(), torch::kCPU);
    REQUIRE(loaded.run.counters.step == interrupt_at);
    Trainer second(loaded.run, scene, supervision, folder.path());
    second.Resume(loaded.extra);
    second.Train();
  } else {
    Trainer trainer(run, scene, supervision, folder.path());
    trainer.Train();
  }
  return ReadSafetensors(folder.path() / "checkpoint.safetensors").tensors;
}

void CheckSameBits(const Tensors& a, const Tensors& b) {
  REQUIRE(a.size() == b.size());
  for (const auto& [name, tensor] : a) {
    INFO(name);
    CHECK(torch::equal(tensor, b.at(name)));
  }
}

// Restores the tests' number of threads.
class Threads {
 public:
  explicit Threads(int64_t count) : before_(NumThreads()) { SetNumThreads(count); }
  ~Threads() { SetNumThreads(before_); }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

 private:
  int64_t before_;
};

}  // namespace

TEST_CASE("the same seed and threads give the same weights, moments and occupancy, bit by bit") {
  for (const int64_t count : {1, 3}) {
    const Threads threads(count);
    for (const Case& c : AllCases()) {
      INFO(c.name << ", " << count << " threads");
      CheckSameBits(Trained(c), Trained(c));
    }
  }
}

TEST_CASE("a resumed run ends with the weights, moments and occupancy of one that was not interrupted, bit by bit") {
  const Threads threads(2);
  for (const Case& c : AllCases()) {
    INFO(c.name);
    CheckSameBits(Trained(c), Trained(c, kInterrupted));
  }
}

// Bounds: sums in another order differ by their rounding, and Adam makes whole steps of gradients that are nothing but
// rounding.
TEST_CASE("other numbers of threads give the same losses, within 1e-5 at first and 2 % after twenty steps") {
  for (const Case& c : AllCases()) {
    const auto losses_with = [&](int64_t count) {
      const Threads threads(count);
      torch::manual_seed(5);
      const bool train = c.stage == FieldStage::kTrain;
      Trainer trainer(
          MakeRun(c.config, c.stage, TinyScene(), train ? TrueTracks(TinyScene()) : torch::Tensor(), torch::kCPU),
          TinyScene(), std::nullopt, Scratch("threads"));
      std::vector<double> losses;
      for (int64_t i = 0; i < kSteps; ++i) losses.push_back(trainer.Step().at("reconstruction"));
      return losses;
    };
    const std::vector<double> one = losses_with(1), three = losses_with(3);
    for (size_t i = 0; i < one.size(); ++i) {
      INFO(c.name << ", step " << i);
      CHECK(three[i] == Approx(one[i]).epsilon(i == 0 ? 1e-5 : 0.02));
    }
  }
}
