#include "libeditnerf/render/ray_renderer.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "libeditnerf/kernels/ray_cursor.h"
#include "libeditnerf/render/sampling.h"

namespace editnerf {
namespace {

// Transmittance below which the accumulated weight has passed 0.5 for certain, with a margin for rounding.
constexpr double kSurfaceStop = 0.45;
// Without gradients the field sees this many samples at a time: the paper's networks hold 1 KB per layer and sample.
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
  const auto fused = field.Fused();
  if (FusedMarching::Takes(fused, {}, states)) {
    return FusedDensity(FieldKernel(*fused, FusedStatesOf(field, states)), x, state);
  }
  const auto table = AnyTable(states);
  FieldInput input;
  input.x_observed = table.defined() ? x.to(table.dtype()) : x;
  input.state = state;
  return EvaluateField(field, input, states, Level::kFine, /*with_color=*/false).density;
}

// Sum over some samples of w max(0, |t - d| / d - tolerance), where the ray's distance d is known.
torch::Tensor DepthMiss(const torch::Tensor& weights, const torch::Tensor& t, const torch::Tensor& distance,
                        const torch::Tensor& tolerance) {
  torch::Tensor miss;
  {
    const torch::NoGradGuard no_grad;
    miss = torch::nan_to_num(((t / distance - 1).abs() - tolerance).clamp_min(0), 0.0, 0.0);
  }
  return (weights * miss).sum();
}

OccupancyBits BitsOf(const OccupancyGrid& grid, int64_t resolution) {
  const auto buffers = grid.named_buffers(/*recurse=*/false);
  return {buffers["low"], buffers["high"], buffers["occupied"], resolution};
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
  if (options.distortion) result.distortion = DistortionLoss(fine.weights, t + delta / 2, delta) / (far_ - near_);
  if (options.distance.defined()) {
    result.depth_miss = DepthMiss(fine.weights, t, options.distance.unsqueeze(1), options.tolerance.unsqueeze(1)) /
                        static_cast<double>(count);
  }
  result.samples = t.numel();
  return result;
}

// What may be seen of the rays: samples where the grids are occupied.
PackedSamples RayRenderer::March(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                                 const Marching& marching) const {
  const torch::Tensor& jitter = marching.jitter;
  torch::Tensor anchor, turn;
  if (local_grid_) {
    CheckShape(states.key_points, {kAny, 1, 3}, "key_points");
    anchor = states.key_points.select(1, 0).index_select(0, rays.state);
    turn = field.LocalFramesOf(states.key_points);
    if (turn.defined()) turn = turn.select(1, 0).index_select(0, rays.state);
  }
  if (KernelsTake({rays.origin, rays.direction, jitter, anchor, turn})) {
    return MarchRays({rays.origin, rays.direction, jitter, anchor, turn}, near_, far_, marching.steps, marching.grid,
                     marching.local_grid ? &*marching.local_grid : nullptr);
  }
  const int64_t count = rays.origin.size(0);
  const auto near = rays.origin.new_full({count}, near_), far = rays.origin.new_full({count}, far_);
  const auto t = MarchCandidates(near, far, marching.steps, jitter);
  const auto x = rays.origin.unsqueeze(1) + t.unsqueeze(2) * rays.direction.unsqueeze(1);
  auto occupied = grid_->Occupied(x);
  if (local_grid_) {
    auto local = x - anchor.unsqueeze(1);
    if (turn.defined()) local = torch::matmul(local, turn.transpose(1, 2));
    occupied = torch::logical_and(occupied, local_grid_->Occupied(local));
  }
  return PackSamples(t, torch::full_like(t, (far_ - near_) / static_cast<double>(marching.steps)), occupied);
}

Marching RayRenderer::MarchingFor(const RayBatch& rays, const RayOptions& options) const {
  const auto like = rays.origin.new_empty({rays.origin.size(0)});
  Marching marching;
  marching.near = near_;
  marching.far = far_;
  marching.steps = options.march_steps > 0 ? options.march_steps : config_.march_steps;
  marching.early_stop = options.depth_only ? kSurfaceStop : config_.early_stop;
  marching.grid = BitsOf(*grid_, config_.occupancy_resolution);
  if (local_grid_) marching.local_grid = BitsOf(*local_grid_, config_.occupancy_resolution);
  marching.jitter = options.jitter.defined() ? options.jitter
                    : options.training       ? torch::rand_like(like)
                                             : torch::full_like(like, 0.5);
  return marching;
}

bool RayRenderer::Fuses(const RadianceField& field, const RayBatch& rays, const FrameStates& states) const {
  return grid_ && FusedMarching::Takes(field.Fused(), rays, states);
}

std::optional<RayGradients> RayRenderer::AddGradients(RadianceField& field, const RayBatch& rays,
                                                      const FrameStates& states, const RayOptions& options,
                                                      const RayObjective& objective) {
  const auto fused = field.Fused();
  if (!grid_ || !FusedMarching::Takes(fused, rays, states)) return std::nullopt;
  // Local frames follow from the key points: what they get goes on to both the field and the key points.
  torch::Tensor key_points, frames, to_frames;
  if (states.key_points.defined()) {
    const torch::AutoGradMode with_gradients(true);
    key_points = states.key_points.detach().requires_grad_(true);
    frames = field.LocalFramesOf(key_points);
  }
  const FusedStates read = FusedStatesOf(states, frames.defined() ? frames.detach() : frames);
  RayGradients found =
      fused_->AddGradients(*fused, rays, read, options, objective, MarchingFor(rays, options), &to_frames);
  if (frames.defined()) {
    frames.backward(to_frames);
    if (key_points.grad().defined()) found.states.key_points = found.states.key_points + key_points.grad();
  }
  return found;
}

RayResult RayRenderer::RenderMarching(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                                      const RayOptions& options) {
  const Marching marching = MarchingFor(rays, options);
  if (!torch::GradMode::is_enabled() && !options.distortion) {
    const auto fused = field.Fused();
    if (FusedMarching::Takes(fused, rays, states)) {
      return fused_->Render(*fused, rays, FusedStatesOf(field, states), options, marching);
    }
  }
  PackedSamples samples;
  {
    torch::NoGradGuard no_grad;
    samples = March(field, rays, states, marching);
    if (options.start.defined()) {
      const double earlier = kSamplesBeforeStart * (far_ - near_) / static_cast<double>(marching.steps);
      samples = SamplesFrom(samples, options.start - earlier);
    }
    if (marching.early_stop > 0) {
      samples = MarchUntilOpaque(samples, marching.early_stop, [&](const PackedSamples& wave) {
        return EvaluateField(field, InputAt(rays, wave.ray, wave.t), states, Level::kFine, /*with_color=*/false)
            .density;
      });
    }
  }
  const auto input = InputAt(rays, samples.ray, samples.t);
  const auto output = EvaluateField(field, input, states, Level::kFine, /*with_color=*/!options.depth_only);
  const auto seen = CompositeSamples(samples, output.density, output.radiance, options.background, options.distortion);
  RayResult result;
  result.rgb = seen.rgb;
  result.opacity = seen.opacity;
  result.depth = seen.depth;
  result.depth_valid = seen.depth_valid;
  if (options.distortion) result.distortion = seen.distortion / (far_ - near_);
  if (options.distance.defined()) {
    result.depth_miss = DepthMiss(seen.weights, samples.t, options.distance.index_select(0, samples.ray),
                                  options.tolerance.index_select(0, samples.ray)) /
                        static_cast<double>(rays.origin.size(0));
  }
  if (options.surface) FillSurface(input, output, seen.surface_sample, result);
  result.samples = samples.t.size(0);
  return result;
}

// Density in the local frame; what lies outside the observed grid is never rendered and counts as empty.
torch::Tensor RayRenderer::LocalDensityAt(RadianceField& field, const torch::Tensor& x_local,
                                          const torch::Tensor& state, const FrameStates& states) const {
  CheckShape(states.key_points, {kAny, 1, 3}, "key_points");
  torch::Tensor in_scene = x_local;
  if (const torch::Tensor turn = field.LocalFramesOf(states.key_points); turn.defined()) {
    const auto back = turn.select(1, 0).transpose(1, 2).index_select(0, state).to(x_local.dtype());
    in_scene = torch::matmul(back, x_local.unsqueeze(2)).squeeze(2);
  }
  const auto x = in_scene + states.key_points.select(1, 0).index_select(0, state);
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
