#include "libeditnerf/pipeline/component_trials.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/training/carried_pixels.h"
#include "libeditnerf/training/generator_guard.h"
#include "libeditnerf/training/held_out.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {
namespace {

constexpr int64_t kRays = 16384;  // held-out pixels
// Of every trial the first, so that they differ by the component alone; the second where by the first a component is
// needed, or local frames do harm.
constexpr uint64_t kSeed = 1, kSecondSeed = 2;
constexpr double kLeastGain = 0.2;   // dB
constexpr double kCodesGain = 0.4;   // dB, of appearance codes, which early on explain what more steps would have shown
constexpr double kMostLoss = 0.3;    // dB, of what detection found, where parts are seen
constexpr double kMostShare = 0.15;  // of a stage's seconds that trials may take, without those of the second seed
constexpr int64_t kMostAmbient = 4;  // ambient coordinates that are tried
constexpr int64_t kClocked = 10;     // steps in that number that say how long a trial will take

struct Component {
  const char* setting;
  Choice* choice;
  bool undecided;         // what it is where it is not tried
  double least_gain;      // dB
  std::string needless;   // why nothing has to be tried
  bool of_parts = false;  // found by detection, and changes nothing but what moves
};

// Held-out PSNR in dB.
struct Measured {
  double all = 0, parts = 0;  // parts: of pixels where parts are seen that move; equal to `all` where none is known

  double Of(bool of_parts) const { return of_parts ? parts : all; }
};

// What one field gives, by the seed of its training.
using MeasuredBySeed = std::map<uint64_t, Measured>;

// A change to what is decided: PSNR before and after, means over the seeds that were asked.
struct Compared {
  double before = 0, after = 0;
  MeasuredBySeed changed;

  double Gain() const { return after - before; }
  const char* Seeds() const { return changed.size() > 1 ? ", the mean of two seeds" : ""; }
};

// Those that the configuration leaves open; what gains most first.
std::vector<Component> OpenComponents(FieldConfig* field, const DetectedKeyPoints& detected) {
  std::vector<Component> all = {
      {"field.fast.local_frames", &field->fast.local_frames, field->HasLocalFrames(), -kMostLoss,
       detected.turns.defined() ? "" : "no part turns", true},
      {"field.use_view_direction", &field->use_view_direction, field->HasViewDirection(), kLeastGain, {}},
      {"field.use_appearance", &field->use_appearance, field->HasAppearance(), kCodesGain, {}},
      {"field.warp.enabled", &field->warp.enabled, field->HasWarp(), kLeastGain, {}},
  };
  std::vector<Component> open;
  for (Component& component : all) {
    if (*component.choice == Choice::kAuto) open.push_back(std::move(component));
  }
  return open;
}

StageConfig& StageOf(FieldStage stage, Config* config) {
  return stage == FieldStage::kPretrain ? config->pretrain : config->train;
}

// The short trainings of one stage.
class ShortTrainings {
 public:
  ShortTrainings(const Scene& scene, const StageRequest& request, FieldStage stage)
      : scene_(scene), request_(request), stage_(stage) {}

  // What one gives, in steps of half the stage's size: what a component brings shows early. `affordable` is asked once,
  // with the seconds that its first steps promise; nothing where it is not.
  std::optional<Measured> After(const Config& config, const DetectedKeyPoints& detected, const DepthTargets& depth,
                                uint64_t seed, const std::function<bool(double seconds)>& affordable = {}) const {
    const GeneratorGuard guard(seed);
    Config trial = config;
    StageConfig& stage = StageOf(stage_, &trial);
    stage.steps = stage.trial_steps;
    stage.seconds = 0;
    // Else the finer half of the local encoding would hardly be there before the trial is over.
    int64_t& window = trial.field.fast.local_window_steps;
    window = std::min(window, stage.trial_steps / 2);
    stage.dump_bad_steps = false;
    for (int64_t* batch : {&stage.rays_per_step, &stage.samples_per_step}) *batch = (*batch + 1) / 2;
    Trainer trainer(MakeRun(trial, stage_, scene_, detected.tracks, request_.device, detected.turns, detected.lamp),
                    scene_, detected.supervision, {});
    trainer.SetDepthTargets(depth);
    trainer.SetKnownPlaces(Joined(detected.still_depth, detected.part_depth));
    const Stopwatch clock;
    const int64_t clocked = (stage.steps + kClocked - 1) / kClocked;
    for (int64_t step = 0; step < stage.steps; ++step) {
      trainer.Step();
      if (InterruptRequested()) Throw<Interrupted>("interrupted while the field's components were tried");
      if (step + 1 != clocked || !affordable) continue;
      if (!affordable(clock.Seconds() * static_cast<double>(stage.steps) / static_cast<double>(clocked))) return {};
    }
    trainer.ShowAverage();
    const Run& run = trainer.run();
    run.field->eval();
    Measured psnr;
    psnr.all = *HeldOut(scene_, kRays, request_.device).Psnr(*run.field, *run.renderer);
    const torch::Tensor carried = CarriedPixels(scene_, detected.part_depth, detected.tracks);
    psnr.parts = HeldOut(scene_, carried, kRays, request_.device).Psnr(*run.field, *run.renderer).value_or(psnr.all);
    return psnr;
  }

  // Why none is made; empty where they are.
  std::string WhyNone() const {
    Config config = request_.config;
    if (scene_.val.empty()) return "no validation frames to try it on";
    if (StageOf(stage_, &config).trial_steps > 0) return "";
    return stage_ == FieldStage::kPretrain ? "pretrain.trial_steps is 0" : "train.trial_steps is 0";
  }
  // The same for so many that take `seconds` each.
  std::string WhyTooMany(double seconds, size_t count) const {
    Config config = request_.config;
    const double all = seconds * static_cast<double>(count), limit = StageOf(stage_, &config).seconds;
    if (limit == 0 || all <= kMostShare * limit) return "";
    return fmt::format("trying takes {:.0f} s, more than {:.0f} % of the training time", all, 100 * kMostShare);
  }

 private:
  const Scene& scene_;
  const StageRequest& request_;
  FieldStage stage_;
};

std::string KeyPointSetting(int64_t detected) { return fmt::format("key point {}", detected + 1); }

std::string GainText(double gain, double least = kLeastGain) {
  return gain > least ? fmt::format("{:+.2f} dB", gain)
                      : fmt::format("{:+.2f} dB, expected more than {:.1f}", gain, least);
}

void Say(const ComponentTrial& trial) { LogInfo("{}: {} ({})", trial.setting, trial.on ? "on" : "off", trial.reason); }

// Decides one thing after the other, each with what was decided before.
class Decisions {
 public:
  Decisions(const Scene& scene, const StageRequest& request, const DetectedKeyPoints& detected)
      : trainings_(scene, request, FieldStage::kTrain), request_(request), detected_(detected) {
    decided_.config = request.config;
    decided_.merged = EachByItself(detected.tracks.size(1));
    open_ = OpenComponents(&decided_.config.field, detected);
    const StageConfig& stage = request.config.train;
    if (stage.merge_key_points != Choice::kOff) {
      alike_ = KeyPointsOfOnePart(detected.tracks, request.config.detect.merge_distance);
    }
    const bool try_merging = stage.merge_key_points == Choice::kAuto && !alike_.empty();
    if (open_.empty() && !try_merging) return;
    for (const Component& component : open_) *component.choice = Choice::kOff;
    untried_ = trainings_.WhyNone();
    if (!untried_.empty()) return;
    const size_t count = 1 + open_.size() + (try_merging ? alike_.size() : 0);
    const auto first = trainings_.After(decided_.config, detected_, {}, kSeed, [&](double seconds) {
      untried_ = trainings_.WhyTooMany(seconds, count);
      return untried_.empty();
    });
    if (first) measured_[kSeed] = *first;
  }

  ComponentTrials Make() {
    for (const auto& [first, second] : alike_) Merge(first, second);
    for (const Component& component : open_) Decide(component);
    decided_.seconds = clock_.Seconds();
    return std::move(decided_);
  }

 private:
  Measured Try(const Config& config, const KeyPointMap& map, uint64_t seed) const {
    return *trainings_.After(config, Merged(detected_, map), {}, seed);
  }

  // What changes of configuration and key points bring. Two trainings that differ by nothing but their seed differ by
  // more than what decides, so what the first one finds is asked again where it `matters`.
  Compared Compare(const Config& config, const KeyPointMap& map, bool of_parts,
                   const std::function<bool(double gain)>& matters) {
    Compared compared;
    const auto ask = [&](uint64_t seed) {
      const auto [before, fresh] = measured_.try_emplace(seed);
      if (fresh) before->second = Try(decided_.config, decided_.merged, seed);
      compared.changed[seed] = Try(config, map, seed);
      compared.before += before->second.Of(of_parts);
      compared.after += compared.changed[seed].Of(of_parts);
    };
    ask(kSeed);
    if (!matters(compared.Gain())) return compared;
    ask(kSecondSeed);
    compared.before /= 2;
    compared.after /= 2;
    return compared;
  }

  // The second of two detected key points that move as one part goes where nobody misses it.
  void Merge(int64_t first, int64_t second) {
    if (gone_.count(first) + gone_.count(second) > 0) return;
    const KeyPointMap& map = decided_.merged;
    const KeyPointMap merged = WithMerged(map, map[static_cast<size_t>(first)], map[static_cast<size_t>(second)]);
    ComponentTrial trial;
    trial.setting = KeyPointSetting(second);
    trial.reason = fmt::format("moves as key point {} does", first + 1);
    if (request_.config.train.merge_key_points == Choice::kOn) {
      trial.on = false;
    } else if (!untried_.empty()) {
      trial.on = true;
      trial.reason += ", but " + untried_;
    } else {
      const auto misses = [](double gain) { return -gain > kLeastGain; };
      const Compared without = Compare(decided_.config, merged, false, misses);
      trial.with = without.before;
      trial.without = without.after;
      trial.on = misses(without.Gain());
      trial.reason += ", " + GainText(-without.Gain()) + without.Seeds();
      if (!trial.on) measured_ = without.changed;
    }
    if (!trial.on) {
      trial.merged_into = first;
      gone_.insert(second);
      decided_.merged = merged;
    }
    Keep(trial);
  }

  void Decide(const Component& component) {
    ComponentTrial trial;
    trial.setting = component.setting;
    if (!component.needless.empty()) {
      trial.reason = component.needless;
    } else if (!untried_.empty()) {
      trial.on = component.undecided;
      trial.reason = untried_;
    } else {
      *component.choice = Choice::kOn;
      const Config config = decided_.config;
      *component.choice = Choice::kOff;
      const auto enough = [&](double gain) { return gain > component.least_gain; };
      const Compared with = Compare(config, decided_.merged, component.of_parts,
                                    [&](double gain) { return enough(gain) != component.of_parts; });
      trial.without = with.before;
      trial.with = with.after;
      trial.reason = GainText(with.Gain(), component.least_gain) + (component.of_parts ? " where parts are seen" : "") +
                     with.Seeds();
      trial.on = enough(with.Gain());
      if (trial.on) measured_ = with.changed;
    }
    *component.choice = trial.on ? Choice::kOn : Choice::kOff;
    Keep(trial);
  }

  void Keep(const ComponentTrial& trial) {
    Say(trial);
    decided_.trials.push_back(trial);
  }

  const Stopwatch clock_;
  const ShortTrainings trainings_;
  const StageRequest& request_;
  const DetectedKeyPoints& detected_;
  ComponentTrials decided_;
  std::vector<Component> open_;                     // pointing into decided_.config
  std::vector<std::pair<int64_t, int64_t>> alike_;  // detected key points
  std::string untried_;                             // why no trial is made
  std::set<int64_t> gone_;                          // of them, merged
  MeasuredBySeed measured_;                         // what is decided so far
};

}  // namespace

ComponentTrials DecideComponents(const Scene& scene, const StageRequest& request, const DetectedKeyPoints& detected) {
  return Decisions(scene, request, detected).Make();
}

ComponentTrials DecideAmbient(const Scene& scene, const StageRequest& request, const DepthTargets& depth) {
  const Stopwatch clock;
  ComponentTrials decided;
  decided.config = request.config;
  SlicingNetworkConfig& slicing = decided.config.field.slicing;
  if (slicing.ambient_dim > 0) return decided;
  const ShortTrainings trainings(scene, request, FieldStage::kPretrain);
  std::string untried = trainings.WhyNone();
  const int64_t undecided = slicing.AmbientDim();
  slicing.ambient_dim = 1;
  double best = 0;
  if (untried.empty()) {
    const auto first = trainings.After(decided.config, {}, depth, kSeed, [&](double seconds) {
      untried = trainings.WhyTooMany(seconds, static_cast<size_t>(kMostAmbient));
      return untried.empty();
    });
    if (first) best = first->all;
  }
  if (!untried.empty()) {
    slicing.ambient_dim = undecided;
    decided.trials.push_back({fmt::format("{} ambient dimensions", undecided), true, {}, {}, untried, {}});
    Say(decided.trials.back());
  }
  for (bool gains = untried.empty(); gains && slicing.ambient_dim < kMostAmbient;) {
    ComponentTrial trial;
    trial.setting = fmt::format("{} ambient dimensions", ++slicing.ambient_dim);
    trial.without = best;
    trial.with = trainings.After(decided.config, {}, depth, kSeed)->all;
    trial.reason = GainText(*trial.with - best);
    trial.on = gains = *trial.with - best > kLeastGain;
    if (gains) {
      best = *trial.with;
    } else {
      --slicing.ambient_dim;
    }
    Say(trial);
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
    if (trial.merged_into) entry["merged_into"] = *trial.merged_into;
  }
  return json;
}

KeyPointMap ReadMerged(const std::filesystem::path& path, int64_t num_key_points) {
  KeyPointMap stands_for = EachByItself(num_key_points);
  if (!std::filesystem::exists(path)) return stands_for;
  const Json json = ReadJson(path);
  for (int64_t n = 0; n < num_key_points; ++n) {
    const auto trial = json.find(KeyPointSetting(n));
    if (trial == json.end() || !trial->contains("merged_into")) continue;
    const std::string where = fmt::format("{}: {}", path.string(), KeyPointSetting(n));
    const int64_t into = JsonInteger(*trial, "merged_into", where);
    if (into < 0 || into >= n) Throw<DataError>("{}: merged_into: expected one before it, found {}", where, into);
    stands_for[static_cast<size_t>(n)] = stands_for[static_cast<size_t>(into)];
  }
  KeyPointMap numbers = stands_for;
  int64_t left = 0;
  for (size_t n = 0; n < numbers.size(); ++n) {
    const auto own = static_cast<size_t>(stands_for[n]);
    numbers[n] = own == n ? left++ : numbers[own];
  }
  return numbers;
}

}  // namespace editnerf
