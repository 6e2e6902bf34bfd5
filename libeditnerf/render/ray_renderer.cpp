#include "libeditnerf/render/ray_renderer.h"

#include <torch/torch.h>

#include <algorithm>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/render/sampling.h"

namespace editnerf {
namespace {

// Without gradients the field sees this many samples at a time: the paper's networks hold 1 KB per layer and sample.
// Transmittance below which the accumulated weight has passed 0.5 for certain, with a margin for rounding.
constexpr double kSurfaceStop = 0.45;
constexpr int64_t kSlice = int64_t{1} << 17;

FieldInput InputRows(const FieldInput& input, int64_t first, int64_t count) {
  FieldInput rows;
  rows.x_observed = input.x_observed.narrow(0, first, count);
  if (input.direction.defined()) rows.direction = input.direction.narrow(0, first, count);
  rows.state = input.state.narrow(0, first, count);
  return rows;
}

torch::Tensor Joined(const std::vector<FieldOutput>& parts, torch::Tensor FieldOutput::*member) {
  std::vector<torch::Tensor> tensors;
  for (const auto& part : parts) {
    if (!(part.*member).defined()) return {};
    tensors.push_back(part.*member);
  }
  return torch::cat(tensors);
}

FieldOutput EvaluateField(RadianceField& field, const FieldInput& input, const FrameStates& states, Level level,
                          bool with_color) {
  const auto evaluate = [&](const FieldInput& rows) {
    return with_color ? field.Evaluate(rows, states, level) : field.EvaluateDensity(rows, states, level);
  };
  const int64_t count = input.x_observed.size(0);
  if (torch::GradMode::is_enabled() || count <= kSlice) return evaluate(input);
  std::vector<FieldOutput> parts;
  for (int64_t first = 0; first < count; first += kSlice) {
    parts.push_back(evaluate(InputRows(input, first, std::min(kSlice, count - first))));
  }
  FieldOutput output;
  for (const auto member : {&FieldOutput::density, &FieldOutput::radiance, &FieldOutput::x_canonical,
                            &FieldOutput::ambient, &FieldOutput::anchor, &FieldOutput::weights}) {
    output.*member = Joined(parts, member);
  }
  return output;
}

// Positions t along rays that are given row by row.
FieldInput InputAt(const RayBatch& rays, const torch::Tensor& ray, const torch::Tensor& t) {
  FieldInput input;
  input.direction = rays.direction.index_select(0, ray);
  input.x_observed = rays.origin.index_select(0, ray) + t.unsqueeze(1) * input.direction;
  input.state = rays.state.index_select(0, ray);
  return input;
}

// Surface outputs from the rows `row` [R] of the samples.
void FillSurface(const FieldInput& input, const FieldOutput& output, const torch::Tensor& row, RayResult& result) {
  const auto at = [&](const torch::Tensor& values) {
    return values.defined() ? values.index_select(0, row) : torch::Tensor();
  };
  result.x_observed = at(input.x_observed);
  result.x_canonical = at(output.x_canonical);
  result.ambient = at(output.ambient);
  result.weights = at(output.weights);
}

// The first table of the states that is there, for their number and type; undefined if none is.
torch::Tensor AnyTable(const FrameStates& states) {
  for (const auto& table : {states.key_points, states.warp_code, states.appearance_code}) {
    if (table.defined()) return table;
  }
  return {};
}

int64_t CountStates(const FrameStates& states) {
  const auto table = AnyTable(states);
  return table.defined() ? table.size(0) : 1;
}

torch::Tensor DensityAt(RadianceField& field, const torch::Tensor& x, const torch::Tensor& state,
                        const FrameStates& states) {
  const auto table = AnyTable(states);
  FieldInput input;
  input.x_observed = table.defined() ? x.to(table.dtype()) : x;
  input.state = state;
  return EvaluateField(field, input, states, Level::kFine, /*with_color=*/false).density;
}

}  // namespace

RayRenderer::RayRenderer(const RenderConfig& config, double near, double far, const Box& box,
                         const std::optional<Box>& local_box)
    : config_(config), near_(near), far_(far) {
  if (!(near >= 0 && near < far)) Throw<ConfigError>("renderer: near {}, far {}: expected 0 <= near < far", near, far);
  if (config.sampler != "hierarchical" && config.sampler != "occupancy") {
    Throw<ConfigError>("render.sampler: found '{}', expected 'hierarchical' or 'occupancy'", config.sampler);
  }
  if (config.sampler != "occupancy") return;
  OccupancyOptions options;
  options.resolution = config.occupancy_resolution;
  options.threshold = config.occupancy_threshold;
  options.step = (far - near) / static_cast<double>(config.march_steps);
  grid_ = register_module("grid", std::make_shared<OccupancyGrid>(box, options));
  if (local_box) local_grid_ = register_module("local_grid", std::make_shared<OccupancyGrid>(*local_box, options));
}

RayResult RayRenderer::Render(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                              const RayOptions& options) {
  CheckShape(rays.origin, {kAny, 3}, "origin");
  CheckShape(rays.direction, {rays.origin.size(0), 3}, "direction");
  CheckShape(rays.state, {rays.origin.size(0)}, "state");
  if (rays.origin.size(0) == 0)
    Throw<ShapeError>("origin: expected at least one ray, found {}", ShapeString(rays.origin));
  return grid_ ? RenderMarching(field, rays, states, options) : RenderHierarchical(field, rays, states, options);
}

RayResult RayRenderer::RenderHierarchical(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                                          const RayOptions& options) {
  const int64_t count = rays.origin.size(0);
  const bool opaque_end = !options.background.defined();
  const auto near = rays.origin.new_full({count}, near_), far = rays.origin.new_full({count}, far_);
  const auto ray_numbers = torch::arange(count, rays.state.options());
  RayResult result;

  auto t = StratifiedSamples(near, far, config_.coarse_samples, options.training);
  if (config_.fine_samples > 0 || field.has_coarse_level()) {
    const bool with_color = options.training && field.has_coarse_level();
    torch::AutoGradMode gradients(with_color && torch::GradMode::is_enabled());
    const auto input = InputAt(rays, ray_numbers.repeat_interleave(t.size(1)), t.reshape({-1}));
    const auto output = EvaluateField(field, input, states, Level::kCoarse, with_color);
    const auto coarse = ComputeRayWeights(output.density.view(t.sizes()), IntervalLengths(t, far), opaque_end);
    if (with_color) {
      result.rgb_coarse = CompositeColor(coarse, output.radiance.view({count, t.size(1), 3}), options.background);
    }
    if (config_.fine_samples > 0 && t.size(1) >= 3) {
      t = HierarchicalSamples(t, coarse.weights, config_.fine_samples, options.training);
    }
  }

  const auto delta = IntervalLengths(t, far);
  const auto input = InputAt(rays, ray_numbers.repeat_interleave(t.size(1)), t.reshape({-1}));
  const auto output = EvaluateField(field, input, states, Level::kFine, /*with_color=*/true);
  const auto fine = ComputeRayWeights(output.density.view(t.sizes()), delta, opaque_end);
  result.rgb = CompositeColor(fine, output.radiance.view({count, t.size(1), 3}), options.background);
  result.opacity = fine.opacity;
  const auto surface = FindSurface(fine.weights, t, opaque_end);
  result.depth = surface.depth;
  result.depth_valid = surface.valid;
  if (options.surface) FillSurface(input, output, ray_numbers * t.size(1) + surface.index, result);
  result.sample_weights = fine.weights;
  result.interval_center = (t + delta / 2 - near_) / (far_ - near_);
  result.interval_length = delta / (far_ - near_);
  result.samples = t.numel();
  return result;
}

torch::Tensor RayRenderer::OccupiedAlong(const RayBatch& rays, const torch::Tensor& t,
                                         const FrameStates& states) const {
  const auto x = rays.origin.unsqueeze(1) + t.unsqueeze(2) * rays.direction.unsqueeze(1);
  auto occupied = grid_->Occupied(x);
  if (local_grid_) {
    CheckShape(states.key_points, {kAny, 1, 3}, "key_points");
    const auto anchor = states.key_points.select(1, 0).index_select(0, rays.state).unsqueeze(1);
    occupied = torch::logical_and(occupied, local_grid_->Occupied(x - anchor));
  }
  return occupied;
}

RayResult RayRenderer::RenderMarching(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                                      const RayOptions& options) {
  const int64_t count = rays.origin.size(0);
  const auto near = rays.origin.new_full({count}, near_), far = rays.origin.new_full({count}, far_);
  const int64_t steps = options.march_steps > 0 ? options.march_steps : config_.march_steps;
  const double step = (far_ - near_) / static_cast<double>(steps);
  PackedSamples samples;
  {
    torch::NoGradGuard no_grad;
    const auto within = options.jitter.defined() ? options.jitter
                        : options.training       ? torch::rand_like(near)
                                                 : torch::full_like(near, 0.5);
    const auto t = MarchCandidates(near, far, steps, within);
    samples = PackSamples(t, torch::full_like(t, step), OccupiedAlong(rays, t, states));
    const double early_stop = options.depth_only ? kSurfaceStop : config_.early_stop;
    if (early_stop > 0) {
      samples = MarchUntilOpaque(samples, early_stop, [&](const PackedSamples& wave) {
        return EvaluateField(field, InputAt(rays, wave.ray, wave.t), states, Level::kFine, /*with_color=*/false)
            .density;
      });
    }
  }
  const auto input = InputAt(rays, samples.ray, samples.t);
  const auto output = EvaluateField(field, input, states, Level::kFine, /*with_color=*/!options.depth_only);
  const RayPadding padding(samples);
  const auto t = padding.Pad(samples.t), delta = padding.Pad(samples.delta);
  const auto weights = ComputeRayWeights(padding.Pad(output.density), delta, /*opaque_end=*/false);

  RayResult result;
  if (!options.depth_only) result.rgb = CompositeColor(weights, padding.Pad(output.radiance), options.background);
  result.opacity = weights.opacity;
  const auto surface = FindSurface(weights.weights, t, /*opaque_end=*/false);
  result.depth = surface.depth;
  result.depth_valid = surface.valid;
  if (options.surface) {
    const auto row = (samples.offsets.narrow(0, 0, count) + surface.index).clamp_max(samples.t.size(0) - 1);
    FillSurface(input, output, row, result);
  }
  result.sample_weights = weights.weights;
  result.interval_center = (t - near_) / (far_ - near_);
  result.interval_length = delta / (far_ - near_);
  result.samples = samples.t.size(0);
  return result;
}

// Density in the local frame; what lies outside the observed grid is never rendered and counts as empty.
torch::Tensor RayRenderer::LocalDensityAt(RadianceField& field, const torch::Tensor& x_local,
                                          const torch::Tensor& state, const FrameStates& states) const {
  CheckShape(states.key_points, {kAny, 1, 3}, "key_points");
  const auto x = x_local + states.key_points.select(1, 0).index_select(0, state);
  const auto density = DensityAt(field, x, state, states);
  return torch::where(grid_->Inside(x), density, torch::zeros_like(density));
}

void RayRenderer::UpdateOccupancy(RadianceField& field, const FrameStates& states) {
  if (!grid_) return;
  torch::NoGradGuard no_grad;
  const auto random_states = [&](const torch::Tensor& x) {
    return torch::randint(CountStates(states), {x.size(0)}, x.options().dtype(torch::kInt64));
  };
  grid_->Update([&](const torch::Tensor& x) { return DensityAt(field, x, random_states(x), states); });
  if (!local_grid_) return;
  local_grid_->Update([&](const torch::Tensor& x) { return LocalDensityAt(field, x, random_states(x), states); });
}

void RayRenderer::CoverStates(RadianceField& field, const FrameStates& states) {
  if (!grid_) return;
  torch::NoGradGuard no_grad;
  for (int64_t row = 0; row < CountStates(states); ++row) {
    const auto this_state = [&](const torch::Tensor& x) {
      return torch::full({x.size(0)}, row, x.options().dtype(torch::kInt64));
    };
    grid_->Cover([&](const torch::Tensor& x) { return DensityAt(field, x, this_state(x), states); });
    if (!local_grid_) continue;
    local_grid_->Cover([&](const torch::Tensor& x) { return LocalDensityAt(field, x, this_state(x), states); });
  }
}

}  // namespace editnerf
