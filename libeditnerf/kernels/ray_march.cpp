#include "libeditnerf/kernels/ray_march.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/ray_cursor.h"

namespace editnerf {
namespace {

constexpr int64_t kGrain = 64;  // rays

at::Tensor Floats(const at::Tensor& tensor, const char* name) {
  if (!tensor.is_cpu() || tensor.scalar_type() != torch::kFloat32) {
    Throw<ShapeError>("marching: {}: expected float32 on the CPU, found {}", name, tensor.toString());
  }
  return tensor.contiguous();
}

}  // namespace

PackedSamples MarchRays(const MarchedRays& rays, double near, double far, int64_t steps, const OccupancyBits& grid,
                        const OccupancyBits* local) {
  CheckShape(rays.origin, {kAny, 3}, "origin");
  const int64_t count = rays.origin.size(0);
  CheckShape(rays.direction, {count, 3}, "direction");
  CheckShape(rays.jitter, {count}, "jitter");
  if (count < 1 || steps < 1) Throw<ShapeError>("marching: expected rays and steps, found {} and {}", count, steps);
  const at::Tensor origins = Floats(rays.origin, "origin"), directions = Floats(rays.direction, "direction"),
                   jitters = Floats(rays.jitter, "jitter");
  const float *const origin = origins.data_ptr<float>(), *const direction = directions.data_ptr<float>(),
                     *const jitter = jitters.data_ptr<float>();
  at::Tensor anchors, turns;
  const MarchedGrid observed_grid(grid), local_grid = local != nullptr ? MarchedGrid(*local) : MarchedGrid();
  if (local != nullptr) {
    CheckShape(rays.anchor, {count, 3}, "anchor");
    anchors = Floats(rays.anchor, "anchor");
    if (rays.turn.defined()) {
      CheckShape(rays.turn, {count, 3, 3}, "turn");
      turns = Floats(rays.turn, "turn");
    }
  }
  const auto view_of = [&](int64_t ray) -> GridView {
    if (local == nullptr) return {};
    return {&local_grid, anchors.data_ptr<float>() + 3 * ray,
            turns.defined() ? turns.data_ptr<float>() + 9 * ray : nullptr};
  };
  const MarchedSteps equal_steps(near, far, steps);

  const at::Tensor kept = torch::empty({count, steps}, torch::kInt32);  // the steps of each ray, from the left
  PackedSamples samples;
  samples.offsets = torch::zeros({count + 1}, torch::kInt64);
  int32_t* const kept_steps = kept.data_ptr<int32_t>();
  int64_t* const offsets = samples.offsets.data_ptr<int64_t>();
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t ray = begin; ray < end; ++ray) {
      RayCursor cursor(observed_grid, view_of(ray), equal_steps, origin + 3 * ray, direction + 3 * ray, jitter[ray]);
      int32_t* own = kept_steps + ray * steps;
      float t, x[3];
      for (int64_t i = cursor.Next(&t, x); i >= 0; i = cursor.Next(&t, x)) *own++ = static_cast<int32_t>(i);
      offsets[ray + 1] = own - (kept_steps + ray * steps);
    }
  });
  std::partial_sum(offsets, offsets + count + 1, offsets);
  if (offsets[count] == 0) {
    kept_steps[0] = 0;
    std::fill(offsets + 1, offsets + count + 1, 1);
  }

  samples.ray = torch::empty({offsets[count]}, torch::kInt64);
  samples.t = torch::empty({offsets[count]}, torch::kFloat32);
  samples.delta = torch::full({offsets[count]}, (far - near) / static_cast<double>(steps), torch::kFloat32);
  int64_t* const ray_out = samples.ray.data_ptr<int64_t>();
  float* const t_out = samples.t.data_ptr<float>();
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t ray = begin; ray < end; ++ray) {
      const int32_t* own = kept_steps + ray * steps;
      for (int64_t s = offsets[ray]; s < offsets[ray + 1]; ++s) {
        ray_out[s] = ray;
        t_out[s] = equal_steps.Position(*own++, jitter[ray]);
      }
    }
  });
  return samples;
}

}  // namespace editnerf
