#include "libeditnerf/render/fused_marching.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/kernel_use.h"

namespace editnerf {
namespace {

torch::Tensor Floats(const torch::Tensor& tensor) { return tensor.to(torch::kCPU, torch::kFloat32).contiguous(); }

// Rays as the kernels read them, and what keeps that memory alive.
struct RaysInMemory {
  torch::Tensor origin, direction, jitter, state, start;
  MarchedGrid grid, local_grid;
  BundledRays rays;

  RaysInMemory(const RayBatch& batch, const Marching& marching, const FieldKernel& field)
      : origin(Floats(batch.origin)),
        direction(Floats(batch.direction)),
        jitter(Floats(marching.jitter)),
        state(batch.state.to(torch::kCPU, torch::kInt64).contiguous()),
        grid(marching.grid) {
    rays.count = origin.size(0);
    CheckShape(jitter, {rays.count}, "jitter");
    rays.origin = origin.data_ptr<float>();
    rays.direction = direction.data_ptr<float>();
    rays.jitter = jitter.data_ptr<float>();
    rays.state = state.data_ptr<int64_t>();
    const auto [least, most] = std::minmax_element(rays.state, rays.state + rays.count);
    if (rays.count > 0 && (*least < 0 || (field.num_states() >= 0 && *most >= field.num_states()))) {
      Throw<ShapeError>("state: expected rows 0 to {} of the frame states, found {} to {}", field.num_states() - 1,
                        *least, *most);
    }
    rays.grid = &grid;
    if (marching.local_grid) {
      if (field.field().num_key_points != 1) {
        Throw<ShapeError>("key_points: the local grid expects one, found {}", field.field().num_key_points);
      }
      local_grid = MarchedGrid(*marching.local_grid);
      rays.local_grid = &local_grid;
    }
    rays.steps = MarchedSteps(marching.near, marching.far, marching.steps);
    rays.delta = static_cast<float>((marching.far - marching.near) / static_cast<double>(marching.steps));
    rays.early_stop = marching.early_stop;
  }
  void SetStart(const torch::Tensor& distance) {
    if (!distance.defined()) return;
    CheckShape(distance, {rays.count}, "start");
    start = Floats(distance);
    rays.start = start.data_ptr<float>();
  }
  RaysInMemory(const RaysInMemory&) = delete;
  RaysInMemory& operator=(const RaysInMemory&) = delete;
};

torch::Tensor RowsOf(const torch::Tensor& colors, int64_t count, const char* name) {
  CheckLastDim(colors, 3, name);
  return Floats(colors.expand({count, 3}));
}

}  // namespace

bool FusedMarching::Takes(const std::optional<FusedField>& field, const RayBatch& rays, const FrameStates& states) {
  return field &&
         KernelsTake({rays.origin, rays.direction, states.key_points, states.warp_code, states.appearance_code});
}

RayResult FusedMarching::Render(const FusedField& field, const RayBatch& rays, const FusedStates& states,
                                const RayOptions& options, const Marching& marching) {
  const FieldKernel kernel(field, states);
  RaysInMemory memory(rays, marching, kernel);
  const int64_t count = memory.rays.count;
  memory.SetStart(options.start);
  RayResult result;
  RayPicture picture;
  torch::Tensor background;
  const auto make = [&](int64_t width) { return torch::empty({count, width}); };
  if (!options.depth_only) {
    result.rgb = make(3);
    picture.rgb = result.rgb.data_ptr<float>();
    if (options.background.defined()) {
      background = RowsOf(options.background, count, "background");
      picture.background = background.data_ptr<float>();
    }
  }
  result.opacity = torch::empty({count});
  result.depth = torch::empty({count});
  result.depth_valid = torch::empty({count}, torch::kBool);
  result.front = torch::empty({count});
  picture.front = result.front.data_ptr<float>();
  picture.color_error = options.color_error;
  picture.opacity = result.opacity.data_ptr<float>();
  picture.depth = result.depth.data_ptr<float>();
  picture.depth_valid = result.depth_valid.data_ptr<bool>();
  if (options.surface) {
    result.x_observed = make(3);
    result.x_canonical = result.x_observed;  // no warp
    picture.x = result.x_observed.data_ptr<float>();
    if (field.ambient_dim > 0) {
      result.ambient = make(field.ambient_dim);
      picture.ambient = result.ambient.data_ptr<float>();
    }
    if (field.num_key_points > 1) {
      result.weights = make(field.num_key_points);
      picture.weights = result.weights.data_ptr<float>();
    }
  }
  result.samples = kernel_.Show(kernel, memory.rays, picture);
  return result;
}

RayGradients FusedMarching::AddGradients(const FusedField& field, const RayBatch& rays, const FusedStates& states,
                                         const RayOptions& options, const RayObjective& objective,
                                         const Marching& marching, torch::Tensor* local_frames) {
  const torch::NoGradGuard no_grad;
  const FieldKernel kernel(field, states);
  RaysInMemory memory(rays, marching, kernel);
  memory.SetStart(options.start);
  const int64_t count = memory.rays.count;
  CheckShape(objective.target, {count, 3}, "target");
  const torch::Tensor target = Floats(objective.target);
  torch::Tensor background;
  RayLoss loss;
  loss.target = target.data_ptr<float>();
  if (options.background.defined()) {
    background = RowsOf(options.background, count, "background");
    loss.background = background.data_ptr<float>();
  }
  loss.distortion = objective.distortion / (marching.far - marching.near);
  loss.ambient = objective.ambient;
  loss.roulette = objective.roulette;
  torch::Tensor distance, tolerance;
  if (objective.depth > 0 && options.distance.defined()) {
    CheckShape(options.distance, {count}, "distance");
    CheckShape(options.tolerance, {count}, "tolerance");
    distance = Floats(options.distance);
    tolerance = Floats(options.tolerance);
    loss.distance = distance.data_ptr<float>();
    loss.tolerance = tolerance.data_ptr<float>();
    loss.depth = objective.depth;
  }
  RayGradients result;
  result.missed = torch::empty({count}, torch::kFloat32);
  loss.missed = result.missed.data_ptr<float>();
  torch::Tensor emphasis;
  if (objective.emphasis.defined()) {
    CheckShape(objective.emphasis, {count}, "emphasis");
    emphasis = Floats(objective.emphasis);
    loss.emphasis = emphasis.data_ptr<float>();
  }
  FusedStates gradients;
  const RayLossSums sums = kernel_.AddGradients(kernel, memory.rays, loss, &gradients);
  const double rays_in_all = static_cast<double>(std::max<int64_t>(count, 1));
  result.reconstruction = sums.reconstruction / rays_in_all;
  result.distortion = sums.distortion / rays_in_all;
  result.ambient = sums.ambient / rays_in_all;
  result.depth = sums.depth / rays_in_all;
  result.samples = sums.samples;
  result.returned = sums.returned;
  result.states.key_points = gradients.key_points;
  result.states.warp_code = gradients.warp_code;
  result.states.appearance_code = gradients.appearance;
  *local_frames = gradients.local_frames;
  return result;
}

}  // namespace editnerf
