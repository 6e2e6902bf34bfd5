#include "libeditnerf/training/memory_plan.h"

#include <fmt/format.h>
#include <torch/nn/module.h>
#include <torch/types.h>

#include <algorithm>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/kernels/fused_field.h"
#include "libeditnerf/kernels/tile.h"
#include "libeditnerf/training/error_map.h"

namespace editnerf {
namespace {

constexpr int64_t kLeastNamed = (1 << 20) / 10;

int64_t Bytes(const torch::Tensor& tensor) {
  return tensor.defined() ? tensor.numel() * static_cast<int64_t>(tensor.element_size()) : 0;
}

int64_t ParameterBytes(const torch::nn::Module& module) {
  int64_t bytes = 0;
  for (const torch::Tensor& parameter : module.parameters()) bytes += Bytes(parameter);
  return bytes;
}

int64_t BufferBytes(const torch::nn::Module& module) {
  int64_t bytes = 0;
  for (const torch::Tensor& buffer : module.buffers()) bytes += Bytes(buffer);
  return bytes;
}

// Outputs of all layers, as a graph keeps them for the backward pass: the rows of all weight matrices.
int64_t LayerOutputs(const torch::nn::Module& module) {
  int64_t outputs = 0;
  for (const auto& item : module.named_parameters()) {
    if (item.value().dim() == 2 && item.key().find("weight") != std::string::npos) outputs += item.value().size(0);
  }
  return outputs;
}

int64_t SampleBytes(const Run& run, int64_t samples) {
  const auto fused = run.field->Fused();
  if (fused && run.config.render.sampler == "occupancy") {
    const FieldRows rows(*fused);
    const int64_t shade = rows.shade_features > 0 ? fused->num_key_points * (3 + rows.shade_features) : 0;
    const int64_t kept = 6 + rows.canonical_features + rows.local_features + shade;  // FeatureGradients
    constexpr int64_t kWorkingTiles = 14;                                            // of a thread
    return static_cast<int64_t>(sizeof(float)) * kTileStride *
           ((samples + kTile - 1) / kTile * kept + NumThreads() * kWorkingTiles * rows.count);
  }
  // A layer's output once before and once after its activation.
  return samples * 2 * LayerOutputs(*run.field) * static_cast<int64_t>(sizeof(float));
}

int64_t SamplesPerStep(const Run& run, const StageConfig& stage) {
  const RenderConfig& render = run.config.render;
  const int64_t per_ray =
      render.sampler == "occupancy" ? render.march_steps : 2 * render.coarse_samples + render.fine_samples;
  const int64_t most = stage.rays_per_step * per_ray;
  return stage.samples_per_step > 0 ? std::min(most, stage.samples_per_step) : most;
}

}  // namespace

int64_t MemoryPlan::Total() const {
  int64_t total = 0;
  for (const auto& part : parts) total += part.second;
  return total;
}

MemoryPlan PlanScene(const Scene& scene) {
  MemoryPlan plan;
  plan.parts.emplace_back("images", Bytes(scene.images));
  if (scene.truth) plan.parts.emplace_back("ground truth", Bytes(scene.truth->depth) + Bytes(scene.truth->mask));
  return plan;
}

MemoryPlan PlanField(const Run& run) {
  const int64_t parameters = ParameterBytes(*run.field);
  return {{{"field", parameters}, {"gradients", parameters}, {"occupancy", BufferBytes(*run.renderer)}}};
}

MemoryPlan PlanMemory(const Run& run, const Scene& scene) {
  const StageConfig& stage = StageOf(run);
  const int64_t parameters = ParameterBytes(*run.field);
  MemoryPlan plan = PlanScene(scene);
  // The trainer selects the training frames' images into a tensor of their own, and the held-out ones for a moment.
  const int64_t frames = scene.images.defined() ? scene.images.size(0) : 0;
  if (frames > 0) plan.parts[0].second += Bytes(scene.images) / frames * static_cast<int64_t>(scene.train.size());
  const MemoryPlan field = PlanField(run);
  plan.parts.insert(plan.parts.end(), field.parts.begin(), field.parts.end());
  plan.parts.emplace_back("Adam", 2 * parameters);
  if (stage.average_weights) plan.parts.emplace_back("mean of the weights", parameters);
  plan.parts.emplace_back("state to roll back to", 3 * parameters + BufferBytes(*run.renderer));
  if (stage.error_share > 0 && frames > 0) {
    const auto trained = static_cast<int64_t>(scene.train.size());
    plan.parts.emplace_back("error map", ErrorMap::Bytes(trained, scene.images.size(1), scene.images.size(2)));
  }
  plan.parts.emplace_back("samples of a step", SampleBytes(run, SamplesPerStep(run, stage)));
  return plan;
}

std::string SizesText(const MemoryPlan& plan) {
  const auto mebibytes = [](int64_t bytes) {
    const double size = static_cast<double>(bytes) / (1 << 20);
    return size < 9.95 ? fmt::format("{:.1f}", size) : fmt::format("{:.0f}", size);
  };
  std::string text = mebibytes(plan.Total()) + " MiB";
  const char* before = ": ";
  for (const auto& [name, bytes] : plan.parts) {
    if (bytes < kLeastNamed) continue;
    text += fmt::format("{}{} {}", before, name, mebibytes(bytes));
    before = ", ";
  }
  return text;
}

std::string ToText(const MemoryPlan& plan) { return "memory beside LibTorch: " + SizesText(plan); }

}  // namespace editnerf
