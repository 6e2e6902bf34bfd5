#include "libeditnerf/pipeline/component_trials.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/training/generator_guard.h"
#include "libeditnerf/training/held_out.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {
namespace {

constexpr int64_t kRays = 16384;     // held-out pixels
constexpr uint64_t kSeed = 1;        // of every trial, so that they differ by the component alone
constexpr double kLeastGain = 0.2;   // dB; runs of the same settings differ by 0.1
constexpr double kMostShare = 0.15;  // of a stage's seconds that trials may take

struct Component {
  const char* setting;
  Choice* choice;
  bool undecided;        // what it is where it is not tried
  std::string needless;  // why nothing has to be tried
};

// Those that the configuration leaves open; what gains most first.
std::vector<Component> OpenComponents(FieldConfig* field, const DetectedKeyPoints& detected) {
  std::vector<Component> all = {
      {"field.fast.local_frames", &field->fast.local_frames, field->HasLocalFrames(),
       detected.turns.defined() ? "" : "no part turns"},
      {"field.use_view_direction", &field->use_view_direction, field->HasViewDirection(), ""},
      {"field.use_appearance", &field->use_appearance, field->HasAppearance(), ""},
      {"field.warp.enabled", &field->warp.enabled, field->HasWarp(), ""},
  };
  std::vector<Component> open;
  for (Component& component : all) {
    if (*component.choice == Choice::kAuto) open.push_back(std::move(component));
  }
  return open;
}

// Of half the size of the stage's steps: what a component brings shows early.
double HeldOutAfterTrial(const Scene& scene, const StageRequest& request, const DetectedKeyPoints& detected,
                         const Config& config) {
  const GeneratorGuard guard(kSeed);
  Config trial = config;
  trial.train.steps = trial.train.trial_steps;
  trial.train.seconds = 0;
  trial.train.dump_bad_steps = false;
  for (int64_t* batch : {&trial.train.rays_per_step, &trial.train.samples_per_step}) *batch = (*batch + 1) / 2;
  Trainer trainer(MakeRun(trial, FieldStage::kTrain, scene, detected.tracks, request.device, detected.turns), scene,
                  detected.supervision, {});
  trainer.SetKnownPlaces(Joined(detected.still_depth, detected.part_depth));
  for (int64_t step = 0; step < trial.train.steps; ++step) {
    trainer.Step();
    if (InterruptRequested()) Throw<Interrupted>("interrupted while the field's components were tried");
  }
  const Run& run = trainer.run();
  run.field->eval();
  return *HeldOut(scene, kRays, request.device).Psnr(*run.field, *run.renderer);
}

std::string GainText(double gain) {
  return gain > kLeastGain ? fmt::format("{:+.2f} dB", gain)
                           : fmt::format("{:+.2f} dB, expected more than {:.1f}", gain, kLeastGain);
}

}  // namespace

ComponentTrials DecideComponents(const Scene& scene, const StageRequest& request, const DetectedKeyPoints& detected) {
  const Stopwatch clock;
  ComponentTrials decided;
  decided.config = request.config;
  Config& config = decided.config;
  const std::vector<Component> open = OpenComponents(&config.field, detected);
  if (open.empty()) return decided;
  for (const Component& component : open) *component.choice = Choice::kOff;

  const StageConfig& stage = config.train;
  std::string untried = scene.val.empty()        ? "no validation frames to try it on"
                        : stage.trial_steps == 0 ? "train.trial_steps is 0"
                                                 : "";
  double best = 0;
  if (untried.empty()) {
    best = HeldOutAfterTrial(scene, request, detected, config);
    if (const double all = clock.Seconds() * static_cast<double>(1 + open.size());
        stage.seconds > 0 && all > kMostShare * stage.seconds) {
      untried = fmt::format("trying takes {:.0f} s, more than {:.0f} % of the training time", all, 100 * kMostShare);
    }
  }
  for (const Component& component : open) {
    ComponentTrial trial;
    trial.setting = component.setting;
    if (!component.needless.empty()) {
      trial.reason = component.needless;
    } else if (!untried.empty()) {
      trial.on = component.undecided;
      trial.reason = untried;
    } else {
      *component.choice = Choice::kOn;
      trial.without = best;
      trial.with = HeldOutAfterTrial(scene, request, detected, config);
      trial.reason = GainText(*trial.with - best);
      trial.on = *trial.with - best > kLeastGain;
      if (trial.on) best = *trial.with;
    }
    *component.choice = trial.on ? Choice::kOn : Choice::kOff;
    LogInfo("{}: {} ({})", trial.setting, trial.on ? "on" : "off", trial.reason);
    decided.trials.push_back(trial);
  }
  decided.seconds = clock.Seconds();
  return decided;
}

nlohmann::ordered_json ToJson(const ComponentTrials& trials) {
  nlohmann::ordered_json json;
  for (const ComponentTrial& trial : trials.trials) {
    nlohmann::ordered_json& entry = json[trial.setting];
    entry["on"] = trial.on;
    if (trial.without) entry["without"] = *trial.without;
    if (trial.with) entry["with"] = *trial.with;
    entry["reason"] = trial.reason;
  }
  return json;
}

}  // namespace editnerf
