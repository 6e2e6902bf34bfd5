#include "libeditnerf/training/trainer.h"

#include <ATen/CPUGeneratorImpl.h>
#include <fmt/format.h>
#include <torch/autograd.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/training/adam_groups.h"
#include "libeditnerf/training/drawn_states.h"
#include "libeditnerf/training/schedule.h"
#include "libeditnerf/training/step_losses.h"

namespace editnerf {
namespace {

constexpr int64_t kHeldOutRays = 8192;
constexpr int64_t kFewestRays = 256;
constexpr int64_t kMostDumps = 3;     // skipped steps that a session writes down
constexpr int64_t kAverageEvery = 8;  // steps, whose weights differ too little to be worth adding them all
constexpr int64_t kSettleEvery = 16;  // steps, in which what rays are drawn by changes little

// Of what a checkpoint keeps beside the run.
const std::string kAdam = "adam.", kAverage = "average.", kErrorMap = "error_map";

void AddGradients(const std::vector<torch::Tensor>& gradients, const std::vector<torch::Tensor>& parameters) {
  const torch::NoGradGuard no_grad;
  for (size_t i = 0; i < gradients.size(); ++i) {
    if (!gradients[i].defined()) continue;
    torch::Tensor& sum = parameters[i].mutable_grad();
    sum = sum.defined() ? sum.add_(gradients[i]) : gradients[i];
  }
}

std::string AdviceFor(const Run& run) {
  return fmt::format("lower {0}.learning_rate (now {1:g}); {0}.dump_bad_steps and enf-replay show what fails",
                     run.stage == FieldStage::kPretrain ? "pretrain" : "train", StageOf(run).learning_rate);
}

}  // namespace

Trainer::Trainer(Run run, const Scene& scene, std::optional<KeyPointSupervision> supervision,
                 std::filesystem::path folder)
    : run_(std::move(run)),
      stage_(StageOf(run_)),
      supervision_(std::move(supervision)),
      folder_(std::move(folder)),
      rays_(scene, scene.train, run_.device),
      held_out_(scene, kHeldOutRays, run_.device),
      adam_(AdamGroupsFor(*run_.field, stage_), AdamOptionsFor(run_.config)),
      average_(adam_.parameters()),
      recovery_(AdviceFor(run_)) {
  if (supervision_) {
    supervision_->flow = supervision_->flow.to(run_.device);
    supervision_->depth = supervision_->depth.to(run_.device);
  }
  if (stage_.error_share > 0) rays_.DrawByError(stage_.error_share);
  run_.field->train();
}

void Trainer::SetKnownPlaces(const DepthTargets& places) {
  if (run_.field->num_key_points() == 0) return;
  // Parts that turn are lit otherwise at every angle: a ray carried along asks for a colour that is not there.
  rays_.SetKnownPlaces(places, stage_.still_share, run_.field->has_local_frames() ? 0 : stage_.carried_share,
                       run_.field->has_shade());
  if (places.size() == 0) return;
  part_reach_ = PartReach(rays_.Positions(places), places.frame.to(run_.device), places.key_point.to(run_.device),
                          AllStates().key_points);
}

void Trainer::Resume(const SavedState& extra) {
  adam_.LoadState(Under(kAdam, extra));
  average_.LoadState(Under(kAverage, extra));
  resumed_step_ = run_.counters.step;
  const auto generator = extra.find("generator");
  if (generator == extra.end()) Throw<CheckpointError>("checkpoint: the random generator's state is missing");
  if (const auto samples = extra.find("samples_per_ray"); samples != extra.end()) {
    samples_per_ray_ = samples->second.item<double>();
  }
  if (const auto errors = extra.find(kErrorMap); errors != extra.end() && rays_.errors() != nullptr) {
    rays_.errors()->SetState(errors->second);
  }
  at::Generator sequence = at::detail::getDefaultCPUGenerator();
  sequence.set_state(generator->second);
}

double Trainer::Progress() const { return StageProgress(stage_, run_.counters.step, run_.counters.seconds_training); }

void Trainer::AddKeyPointLosses(const torch::Tensor& key_points, NamedTensors* losses) const {
  if (!supervision_ || run_.field->num_key_points() == 0) return;
  for (auto& term : KeyPointLosses(stage_, rays_.cameras(), *supervision_, key_points)) losses->push_back(term);
}

// As many as the last step's samples per ray allow; a fresh run starts from the most that a ray can take.
int64_t Trainer::RaysForStep() const {
  if (stage_.samples_per_step == 0) return stage_.rays_per_step;
  const auto most = static_cast<double>(MarchStepsAt(run_.counters.step, run_.config.render.march_steps));
  const double each = samples_per_ray_ > 0 ? samples_per_ray_ : most;
  const auto affordable = static_cast<int64_t>(static_cast<double>(stage_.samples_per_step) / each);
  return std::clamp(affordable, std::min<int64_t>(kFewestRays, stage_.rays_per_step), stage_.rays_per_step);
}

FrameStates Trainer::AllStates() const {
  return run_.field->States(torch::arange(rays_.cameras().size(), torch::kInt64).to(run_.device));
}

torch::Tensor Trainer::DrawStates(RayTargets* batch) {
  const torch::NoGradGuard no_grad;
  const torch::Tensor known = AllStates().key_points;
  const int64_t first = batch->frame.size(0) - batch->drawn;
  torch::Tensor drawn = DrawKeyPointsClearOf({batch->place, batch->frame.slice(0, first), batch->carrier, part_reach_},
                                             known, run_.field->has_local_frames());
  const torch::Tensor carrier = batch->carrier.clamp_min(0), row = torch::arange(batch->drawn, batch->frame.options());
  const torch::Tensor shift = drawn.index({row, carrier}) - known.index({batch->frame.slice(0, first), carrier});
  batch->rays.origin.slice(0, first) += shift * batch->carrier.ge(0).unsqueeze(1);
  return drawn;
}

FrameStates Trainer::StatesOf(const RayTargets& batch, const torch::Tensor& drawn) const {
  if (!drawn.defined()) return AllStates();
  return WithDrawn(AllStates(), drawn, batch.frame.slice(0, batch.frame.size(0) - batch.drawn),
                   run_.field->has_shade() ? batch.carrier : torch::Tensor());
}

// Everything random that a step's gradients depend on, but for the places of samples along hierarchical rays, which
// follow from the generator's state behind it.
StepInput Trainer::Draw() {
  const int64_t step = run_.counters.step;
  StepInput input;
  RayTargets& batch = input.batch;
  batch = rays_.Sample(RaysForStep());
  const int64_t count = batch.frame.size(0);
  RayOptions& options = input.options;
  options.training = true;
  options.surface = stage_.lambda_ambient > 0 || run_.config.field.HasWarp();
  options.distortion = stage_.lambda_distortion > 0;
  if (stage_.lambda_depth > 0) {
    options.distance = batch.distance;
    options.tolerance = batch.tolerance;
  }
  if (stage_.random_background) options.background = BackgroundOf(rays_.mean_color(), count, step);
  if (run_.config.render.sampler == "occupancy") {
    options.jitter = torch::rand({count}).to(run_.device);
    options.march_steps = MarchStepsAt(step, run_.config.render.march_steps);
  }
  input.state = batch.frame;
  if (batch.drawn == 0) return input;
  input.drawn = DrawStates(&batch);
  options.start = batch.start;
  input.state = input.state.clone();
  input.state.slice(0, count - batch.drawn) =
      rays_.cameras().size() + torch::arange(batch.drawn, input.state.options());
  return input;
}

// Gradients of one step. Marching on the CPU takes a share of the rays in every thread, each with its own graph: that
// beats threads inside every small operation by a factor of two.
StepLosses Trainer::Backward(const StepInput& input) {
  const RayTargets& batch = input.batch;
  const RayOptions& options = input.options;
  const torch::Tensor &state = input.state, &drawn = input.drawn;
  const int64_t count = batch.frame.size(0);
  const bool marching = run_.config.render.sampler == "occupancy";
  const int64_t parts = marching && run_.device.is_cpu() ? std::min(NumThreads(), count) : 1;
  if (auto fused =
          FusedBackward(batch, {batch.rays.origin, batch.rays.direction, state}, StatesOf(batch, drawn), options))
    return *std::move(fused);
  std::vector<StepLosses> losses(static_cast<size_t>(parts));
  // One part's after the other's, as threads that add them whenever they are done would add them in another order and
  // with other bits in every run.
  std::vector<std::vector<torch::Tensor>> gradients(static_cast<size_t>(parts));
  const std::vector<torch::Tensor> parameters = run_.field->parameters();
  ParallelParts(parts, [&](int64_t part) {
    const int64_t begin = count * part / parts, end = count * (part + 1) / parts;
    const auto rows = [&](const torch::Tensor& all) { return all.defined() ? all.slice(0, begin, end) : all; };
    RayOptions own = options;
    own.background = rows(options.background);
    own.jitter = rows(options.jitter);
    own.start = rows(options.start);
    own.distance = rows(options.distance);
    own.tolerance = rows(options.tolerance);
    const FrameStates states = StatesOf(batch, drawn);
    losses[static_cast<size_t>(part)] =
        RayLosses(run_, {rows(batch.rays.origin), rows(batch.rays.direction), rows(state)},
                  {rows(batch.target), rows(batch.emphasis)}, states, own);
    NamedTensors& terms = losses[static_cast<size_t>(part)].terms;
    const double share = static_cast<double>(end - begin) / static_cast<double>(count);
    for (auto& term : terms) term.second = term.second * share;
    if (part == 0) AddKeyPointLosses(states.key_points, &terms);
    torch::Tensor total;
    for (const auto& [name, loss] : terms) total = total.defined() ? total + loss : loss;
    if (parts == 1) {
      total.backward();
    } else {
      gradients[static_cast<size_t>(part)] = torch::autograd::grad({total}, parameters, {}, false, false, true);
    }
  });
  for (const auto& of_part : gradients) AddGradients(of_part, parameters);
  StepLosses sums = losses[0];
  for (auto& [name, sum] : sums.terms) sum = sum.detach();
  std::vector<torch::Tensor> missed = {sums.missed};
  for (size_t part = 1; part < losses.size(); ++part) {
    for (size_t i = 0; i < losses[part].terms.size(); ++i)
      sums.terms[i].second = sums.terms[i].second + losses[part].terms[i].second.detach();
    missed.push_back(losses[part].missed);
    sums.samples += losses[part].samples;
  }
  sums.missed = torch::cat(missed);
  return sums;
}

std::optional<StepLosses> Trainer::FusedBackward(const RayTargets& batch, const RayBatch& rays,
                                                 const FrameStates& states, const RayOptions& options) {
  RayObjective objective;
  objective.target = batch.target;
  objective.emphasis = batch.emphasis;
  objective.distortion = stage_.lambda_distortion;
  if (run_.stage == FieldStage::kPretrain) objective.ambient = stage_.lambda_ambient;
  if (batch.distance.defined()) objective.depth = stage_.lambda_depth;
  objective.roulette = stage_.roulette;
  const auto found = run_.renderer->AddGradients(*run_.field, rays, states, options, objective);
  if (!found) return std::nullopt;
  StepLosses step{{}, found->missed, found->samples};
  NamedTensors& losses = step.terms;
  const auto add = [&](const char* name, double value) {
    losses.emplace_back(name, torch::tensor(value, torch::kFloat64));
  };
  add("reconstruction", found->reconstruction);
  if (objective.ambient > 0) add("ambient", found->ambient);
  if (objective.distortion > 0) add("distortion", found->distortion);
  if (objective.depth > 0) add("depth", found->depth);
  // From the states on, LibTorch takes the gradients to the tables that they come from.
  NamedTensors others;
  AddKeyPointLosses(states.key_points, &others);
  std::vector<torch::Tensor> roots, gradients;
  for (const auto& [name, loss] : others) {
    roots.push_back(loss);
    gradients.push_back(torch::ones_like(loss));
    losses.emplace_back(name, loss.detach());
  }
  for (const auto table : {&FrameStates::key_points, &FrameStates::warp_code, &FrameStates::appearance_code}) {
    if (!(found->states.*table).defined()) continue;
    roots.push_back(states.*table);
    gradients.push_back(found->states.*table);
  }
  if (!roots.empty()) torch::autograd::backward(roots, gradients);
  return step;
}

void Trainer::Count(int64_t rays, int64_t samples) {
  run_.counters.rays += rays;
  run_.counters.samples += samples;
  samples_per_ray_ = static_cast<double>(samples) / static_cast<double>(rays);
}

std::map<std::string, double> Trainer::Step() {
  RunCounters& counters = run_.counters;
  average_.Hide();
  run_.field->SetStep(counters.step);
  if (counters.step % run_.config.render.occupancy_update_every == 0) {
    const torch::NoGradGuard no_grad;
    const TeamPhase phase(Phase::kOccupancy);
    run_.renderer->UpdateOccupancy(*run_.field, AllStates());
  }
  const bool first_failure = guard_.failures_in_a_row() == 0;
  if (ErrorMap* const errors = rays_.errors(); errors != nullptr && counters.step % kSettleEvery == 0) errors->Settle();
  StepInput input = Draw();
  if (!input.options.jitter.defined()) input.generator = at::detail::getDefaultCPUGenerator().get_state();
  adam_.ZeroGrad();
  const StepLosses losses = Backward(input);
  Count(input.batch.frame.size(0), losses.samples);
  rays_.Learn(input.batch, losses.missed);
  const StepVerdict verdict = Check(losses.terms);
  if (verdict.take) {
    recovery_.StepIsGood(run_, adam_);
    TakeStep();
  } else {
    LogWarning("step {} skipped: not finite: {}", counters.step, ListOf(verdict.not_finite));
    counters.AddSkipped(verdict.not_finite);
    if (stage_.dump_bad_steps && first_failure && dumped_++ < kMostDumps) Dump(input);
    if (verdict.roll_back) Recover([&] { recovery_.GoBack(ListOf(verdict.not_finite), &run_, &adam_); });
  }
  ++counters.step;
  return {verdict.losses.begin(), verdict.losses.end()};
}

void Trainer::TakeStep() {
  const TeamPhase phase(Phase::kAdam);
  adam_.Step(ExponentialSchedule(stage_.learning_rate, stage_.final_learning_rate, Progress()));
  if (stage_.average_weights && run_.counters.step % kAverageEvery == kAverageEvery - 1) average_.Add();
}

template <class Restore>
void Trainer::Recover(const Restore& restore) {
  average_.Hide();
  const int64_t before = run_.counters.rolled_back;
  restore();
  if (run_.counters.rolled_back > before) average_.Restart();
}

StepVerdict Trainer::Check(const NamedTensors& losses) {
  const TeamPhase phase(Phase::kGuard);
  return guard_.Check(losses, adam_.parameters());
}

StepVerdict Trainer::Replay(const StepInput& input) {
  if (at::Generator sequence = at::detail::getDefaultCPUGenerator(); input.generator.defined()) {
    sequence.set_state(input.generator);
  }
  run_.field->SetStep(run_.counters.step);
  adam_.ZeroGrad();
  return Check(Backward(input).terms);
}

void Trainer::Dump(const StepInput& input) {
  const std::filesystem::path folder = folder_ / "bad_steps" / fmt::format("{:06}", run_.counters.step);
  SaveStep(run_, input, supervision_, folder);
  LogWarning("{}: the step that was skipped; enf-replay computes it again", folder.string());
}

std::optional<double> Trainer::Measure() {
  ShowAverage();
  run_.field->eval();
  const std::optional<double> psnr = held_out_.Psnr(*run_.field, *run_.renderer);
  run_.field->train();
  return psnr;
}

void Trainer::Log(const std::map<std::string, double>& losses, std::optional<double> psnr) {
  const RunCounters& c = run_.counters;
  const MetricsRow row = {c.seconds_training, c.seconds_total, c.step, c.rays, c.samples, losses, psnr};
  if (!log_) {
    std::vector<std::string> terms;
    for (const auto& [name, value] : losses) terms.push_back(name);
    log_.emplace(folder_ / "metrics.csv", terms, resumed_step_);
  }
  log_->Append(row);
}

void Trainer::Save() {
  Recover([&] { recovery_.MakeFit(/*last_steps_failed=*/false, &run_, &adam_); });
  ShowAverage();
  SavedState extra;
  PutUnder(kAdam, adam_.State(), &extra);
  PutUnder(kAverage, average_.State(), &extra);
  extra["samples_per_ray"] = torch::tensor(samples_per_ray_, torch::kFloat64);
  if (ErrorMap* const errors = rays_.errors()) extra[kErrorMap] = errors->State();
  extra["generator"] = at::detail::getDefaultCPUGenerator().get_state();
  SaveRun(run_, folder_, extra);
}

void Trainer::Train() {
  RunCounters& counters = run_.counters;
  MakeFolder(folder_);
  log_.reset();
  const bool pretrain = run_.stage == FieldStage::kPretrain;
  editnerf::Progress bar(pretrain ? "pretraining" : "training", 1.0);
  const double total_before = counters.seconds_total;
  Stopwatch total, training;
  training.Pause();
  double training_before = counters.seconds_training;
  std::string note;
  while (Progress() < 1) {
    training.Resume();
    const std::map<std::string, double> losses = Step();
    training.Pause();
    counters.seconds_training = training_before + training.Seconds();
    counters.seconds_total = total_before + total.Seconds();
    const bool last = Progress() >= 1;
    const bool measure = stage_.evaluate_every > 0 && (counters.step % stage_.evaluate_every == 0 || last);
    if (measure || counters.step % stage_.log_every == 0 || last) {
      std::optional<double> psnr;
      if (measure) psnr = Measure();
      if (psnr) note = fmt::format("held out {:.2f} dB", *psnr);
      Log(losses, psnr);
    }
    bar.Update(Progress(), note);
    if (InterruptRequested()) {
      Save();
      Throw<Interrupted>("interrupted at step {}; the checkpoint is written, continue with --resume", counters.step);
    }
    if (counters.step % stage_.checkpoint_every == 0 && !last) Save();
  }
  bar.Finish(note);
  Recover([&] { recovery_.MakeFit(guard_.failures_in_a_row() > 0, &run_, &adam_); });
  Save();
  if (counters.skipped > 0) LogWarning("{}", SkippedText(counters));
}

}  // namespace editnerf
