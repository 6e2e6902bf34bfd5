#include "libeditnerf/benchmarks/field_kernel_cases.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/kernels/bf16_product.h"
#include "libeditnerf/kernels/field_tile.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "libeditnerf/training/generator_guard.h"
#include "libeditnerf/training/losses.h"

namespace editnerf {
namespace {

constexpr int64_t kSteps = 32;  // of a ray
constexpr int64_t kFrames = 8;
const Box kBox{{-1, -1, -1}, {1, 1, 1}};
constexpr double kNear = 0.05, kFar = 0.45;  // from an origin in the box's inner half no ray leaves it

std::shared_ptr<HyperspaceField> MakeField(const Config& config, const FieldParts& parts, const std::string& kernel) {
  HyperspaceFieldOptions options;
  options.config = config.field;
  options.config.kind = "fast";
  options.config.warp.enabled = Choice::kOff;
  options.config.use_view_direction = parts.view_direction ? Choice::kOn : Choice::kOff;
  options.config.use_appearance = parts.appearance ? Choice::kOn : Choice::kOff;
  options.config.fast.kernel = kernel;
  options.stage = parts.stage;
  options.num_frames = kFrames;
  options.box = kBox;
  if (parts.key_points > 0) {
    options.num_key_points = parts.key_points;
    options.initial_tracks = torch::rand({kFrames, parts.key_points, 3}) - 0.5;
    if (parts.local_frames) options.initial_turns = 2 * torch::rand({kFrames, parts.key_points, 3}) - 1;
  }
  auto field = std::make_shared<HyperspaceField>(options);
  field->SetStep(1'000'000);
  return field;
}

std::vector<int64_t> Widths(const MlpLayers& layers) {
  if (layers.weights.empty()) return {};
  std::vector<int64_t> widths = {layers.weights.front().size(1)};
  for (const torch::Tensor& weight : layers.weights) widths.push_back(weight.size(0));
  return widths;
}

struct Operations {
  double density = 0, forward = 0, both_ways = 0;  // of a sample
};

Operations OperationsOf(const FusedField& field) {
  double encodings = 0, networks = 0;
  for (const FusedHash* hash : {&field.canonical, &field.local}) {
    if (hash->table.defined()) encodings += EncodingOperations(hash->table.size(0));
  }
  for (const MlpLayers* layers : {&field.density, &field.weights, &field.slicing}) {
    networks += NetworkOperations(Widths(*layers));
  }
  const double color = NetworkOperations(Widths(field.color)), forward = encodings + networks + color;
  // Backward: a network's data and weight gradients, and the encodings' once more.
  return {encodings + networks, forward, forward + encodings + 2 * (networks + color)};
}

FrameStates StatesOf(HyperspaceField& field) { return field.States(torch::arange(kFrames, torch::kInt64)); }

template <class Call>
std::function<void()> Plainly(const Call& call) {
  return [call] {
    const PlainOperations only;
    call();
  };
}

}  // namespace

FieldParts OneKeyPoint() { return {"N = 1", FieldStage::kTrain, 1}; }

std::vector<FieldParts> AllFieldParts() {
  const FieldParts one = OneKeyPoint();
  FieldParts without_direction = one, with_appearance = one, with_frames = one;
  without_direction.name += ", no view direction", without_direction.view_direction = false;
  with_appearance.name += ", appearance codes", with_appearance.appearance = true;
  with_frames.name += ", local frames", with_frames.local_frames = true;
  return {{"static (N = 0)", FieldStage::kTrain, 0},
          {"slices (pretraining)", FieldStage::kPretrain, 0},
          without_direction,
          one,
          with_appearance,
          with_frames,
          {"N = 2", FieldStage::kTrain, 2}};
}

FieldSetting MakeFieldSetting(const Config& config, const FieldParts& parts, const std::string& kernel,
                              int64_t samples) {
  const GeneratorGuard same_numbers(1);
  FieldSetting s;
  RenderConfig render;
  render.sampler = "occupancy";
  render.march_steps = kSteps;
  render.occupancy_resolution = config.render.occupancy_resolution;
  render.early_stop = 0;
  s.renderer = std::make_shared<RayRenderer>(render, kNear, kFar, kBox);
  const int64_t rays = samples / kSteps;
  s.rays.origin = torch::rand({rays, 3}) - 0.5;
  const auto toward = torch::rand({rays, 3}) - 0.5;
  s.rays.direction = toward / toward.norm(2, 1, true);
  s.rays.state = torch::randint(kFrames, {rays}, torch::kInt64);
  s.options.background = torch::rand({3});
  s.options.jitter = torch::rand({rays});
  s.objective.target = torch::rand({rays, 3});
  s.objective.distortion = 0.02;
  s.x = torch::rand({rays * kSteps, 3}) - 0.5;
  s.state = torch::randint(kFrames, {rays * kSteps}, torch::kInt64);
  s.field = MakeField(config, parts, kernel);
  return s;
}

torch::Tensor DensityOfPoints(const FieldSetting& s) {
  const torch::NoGradGuard no_grad;
  const FrameStates states = StatesOf(*s.field);
  if (const auto fused = s.field->Fused()) {
    return FusedDensity(FieldKernel(*fused, FusedStatesOf(*s.field, states)), s.x, s.state);
  }
  FieldInput input;
  input.x_observed = s.x;
  input.state = s.state;
  return s.field->EvaluateDensity(input, states, Level::kFine).density;
}

torch::Tensor ColorOfRays(const FieldSetting& s) {
  const torch::NoGradGuard no_grad;
  return s.renderer->Render(*s.field, s.rays, StatesOf(*s.field), s.options).rgb;
}

double AddLossGradients(const FieldSetting& s) {
  const FrameStates states = StatesOf(*s.field);
  RayOptions options = s.options;
  options.distortion = true;
  if (const auto found = s.renderer->AddGradients(*s.field, s.rays, states, options, s.objective)) {
    for (const auto table : {&FrameStates::key_points, &FrameStates::warp_code, &FrameStates::appearance_code}) {
      if ((found->states.*table).defined()) (states.*table).backward(found->states.*table);
    }
    return found->reconstruction + found->distortion;
  }
  const RayResult result = s.renderer->Render(*s.field, s.rays, states, options);
  const torch::Tensor loss =
      ReconstructionLoss(result.rgb, {}, s.objective.target) + s.objective.distortion * result.distortion.mean();
  loss.backward();
  return loss.item<double>();
}

std::vector<std::string> FusedKernelsHere() {
  if (FastestBf16() == Bf16Unit::kNone) return {"fp32"};
  return {"fp32", "bf16"};
}

std::vector<KernelCase> FieldKernelCases(const Config& config, int64_t samples) {
  std::vector<KernelCase> cases;
  for (const std::string& kernel : FusedKernelsHere()) {
    const FieldParts two_key_points = {"N = 2", FieldStage::kTrain, 2};
    const FieldSetting s = MakeFieldSetting(config, two_key_points, kernel, samples);
    const Operations operations = OperationsOf(*s.field->Fused());
    const auto count = static_cast<double>(s.x.size(0));
    const double peak = kernel == "bf16" ? MeasureBf16Peak(FastestBf16()) : 0;
    const auto add = [&](const std::string& name, double of_sample, const std::function<void()>& call) {
      cases.push_back({name + ", " + kernel, count, of_sample, call, Plainly(call), peak});
    };
    add("field, density", operations.density, [s] { DensityOfPoints(s); });
    add("field along rays, forward", operations.forward, [s] { ColorOfRays(s); });
    add("field along rays, both ways", operations.both_ways, [s] { AddLossGradients(s); });
  }
  return cases;
}

std::vector<KernelCase> FieldPartCases(const Config& config, const std::string& kernel, int64_t samples) {
  const FieldSetting one = MakeFieldSetting(config, OneKeyPoint(), kernel, samples);
  std::vector<KernelCase> cases;
  for (const FieldParts& parts : AllFieldParts()) {
    const FieldSetting s = MakeFieldSetting(config, parts, kernel, samples);
    cases.push_back({parts.name, static_cast<double>(s.x.size(0)), OperationsOf(*s.field->Fused()).both_ways,
                     [s] { AddLossGradients(s); }, [one] { AddLossGradients(one); }});
  }
  return cases;
}

}  // namespace editnerf
