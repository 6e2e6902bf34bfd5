#include <torch/torch.h>

#include <memory>

#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/kernels/field_tile.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/render/ray_renderer.h"
#include "libeditnerf/training/losses.h"

namespace editnerf {
namespace {

constexpr int64_t kSteps = 32;  // of a ray, all of them in a grid that is occupied everywhere
constexpr int64_t kFrames = 8, kKeyPoints = 2;

// The field once for each way of evaluating it, and rays through it.
struct Setting {
  std::shared_ptr<HyperspaceField> fused, modules;
  std::shared_ptr<RayRenderer> renderer;
  RayBatch rays;
  RayOptions options;
  RayObjective objective;
  torch::Tensor x, state;  // points in the field
};

std::shared_ptr<HyperspaceField> MakeField(const Config& config, const char* kernel) {
  torch::manual_seed(1);  // the same weights for both
  HyperspaceFieldOptions options;
  options.config = config.field;
  options.config.kind = "fast";
  options.config.warp.enabled = Choice::kOff;
  options.config.fast.kernel = kernel;
  options.num_frames = kFrames;
  options.box = {{-1, -1, -1}, {1, 1, 1}};
  options.num_key_points = kKeyPoints;
  options.initial_tracks = torch::rand({kFrames, kKeyPoints, 3}) - 0.5;
  auto field = std::make_shared<HyperspaceField>(options);
  field->SetStep(1'000'000);
  return field;
}

Setting MakeSetting(const Config& config, int64_t samples) {
  Setting s;
  s.fused = MakeField(config, "auto");
  s.modules = MakeField(config, "modules");
  RenderConfig render;
  render.sampler = "occupancy";
  render.march_steps = kSteps;
  render.occupancy_resolution = config.render.occupancy_resolution;
  render.early_stop = 0;
  s.renderer = std::make_shared<RayRenderer>(render, 0.05, 0.45, Box{{-1, -1, -1}, {1, 1, 1}}, std::nullopt);
  const int64_t rays = samples / kSteps;
  s.rays.origin = torch::rand({rays, 3}) - 0.5;
  const auto toward = torch::rand({rays, 3}) - 0.5;
  s.rays.direction = toward / toward.norm(2, 1, true);
  s.rays.state = torch::randint(kFrames, {rays}, torch::kInt64);
  s.options.background = torch::rand({3});
  s.options.distortion = true;
  s.options.jitter = torch::rand({rays});
  s.objective.target = torch::rand({rays, 3});
  s.objective.distortion = 0.02;
  s.x = torch::rand({rays * kSteps, 3}) - 0.5;
  s.state = torch::randint(kFrames, {rays * kSteps}, torch::kInt64);
  return s;
}

std::vector<int64_t> Widths(const MlpLayers& layers) {
  std::vector<int64_t> widths = {layers.weights.front().size(1)};
  for (const torch::Tensor& weight : layers.weights) widths.push_back(weight.size(0));
  return widths;
}

struct Operations {
  double density_encodings, density_networks, color;
};

Operations OperationsOf(const FusedField& field) {
  Operations operations{};
  for (const FusedHash* hash : {&field.canonical, &field.local}) {
    if (hash->table.defined()) operations.density_encodings += EncodingOperations(hash->table.size(0));
  }
  operations.density_networks = NetworkOperations(Widths(field.density)) + NetworkOperations(Widths(field.weights));
  operations.color = NetworkOperations(Widths(field.color));
  return operations;
}

FrameStates StatesOf(HyperspaceField& field) { return field.States(torch::arange(kFrames, torch::kInt64)); }

void Forget(HyperspaceField& field) {
  for (const torch::Tensor& parameter : field.parameters()) parameter.mutable_grad() = torch::Tensor();
}

void DifferentiateModules(const Setting& s) {
  Forget(*s.modules);
  const RayResult result = s.renderer->Render(*s.modules, s.rays, StatesOf(*s.modules), s.options);
  const torch::Tensor loss =
      ReconstructionLoss(result.rgb, {}, s.objective.target) + s.objective.distortion * result.distortion.mean();
  loss.backward();
}

}  // namespace

std::vector<KernelCase> FieldKernelCases(const Config& config, int64_t samples) {
  const Setting s = MakeSetting(config, samples);
  const Operations operations = OperationsOf(*s.fused->Fused());
  const double density = operations.density_encodings + operations.density_networks, all = density + operations.color;
  const auto count = static_cast<double>(s.x.size(0));
  const auto density_modules = [s] {
    const torch::NoGradGuard no_grad;
    FieldInput input;
    input.x_observed = s.x;
    input.state = s.state;
    s.modules->EvaluateDensity(input, StatesOf(*s.modules), Level::kFine);
  };
  const auto density_fused = [s] {
    const torch::NoGradGuard no_grad;
    FusedDensity(FieldKernel(*s.fused->Fused(), FusedStatesOf(*s.fused, StatesOf(*s.fused))), s.x, s.state);
  };
  const auto show = [s](const std::shared_ptr<HyperspaceField>& field) {
    const torch::NoGradGuard no_grad;
    RayOptions options = s.options;
    options.distortion = false;
    s.renderer->Render(*field, s.rays, StatesOf(*field), options);
  };
  const auto train_fused = [s] {
    Forget(*s.fused);
    s.renderer->AddGradients(*s.fused, s.rays, StatesOf(*s.fused), s.options, s.objective);
  };
  // Backward: a network's data and weight gradients, and the encodings' once more.
  const double backward = operations.density_encodings + 2 * (operations.density_networks + operations.color);
  return {{"field, density", count, density, density_fused, density_modules},
          {"field along rays, forward", count, all, [s, show] { show(s.fused); }, [s, show] { show(s.modules); }},
          {"field along rays, both ways", count, all + backward, train_fused, [s] { DifferentiateModules(s); }}};
}

}  // namespace editnerf
