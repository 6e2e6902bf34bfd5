#include "libeditnerf/kernels/ray_march.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kGrain = 64;  // rays
// Cells by which walls are moved so that less is skipped: far more than rounding, so that every sample that may lie on
// either side of a wall is looked up.
constexpr double kSlack = 1e-3;

struct Grid {
  const bool* occupied;
  int64_t resolution;
  float low[3], scale[3];  // from scene units to cells

  explicit Grid(const OccupancyBits& bits) : resolution(bits.resolution) {
    CheckShape(bits.low, {3}, "occupancy low");
    CheckShape(bits.high, {3}, "occupancy high");
    CheckShape(bits.occupied, {resolution * resolution * resolution}, "occupancy bits");
    if (!bits.occupied.is_cpu() || bits.occupied.scalar_type() != torch::kBool || !bits.occupied.is_contiguous()) {
      Throw<ShapeError>("marching: occupancy: expected bool on the CPU, found {}", bits.occupied.toString());
    }
    occupied = bits.occupied.data_ptr<bool>();
    const auto box_low = bits.low.accessor<double, 1>(), box_high = bits.high.accessor<double, 1>();
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = static_cast<float>(box_low[axis]);
      scale[axis] = static_cast<float>(static_cast<double>(resolution) / (box_high[axis] - box_low[axis]));
    }
  }
};

// One ray in one grid: along an axis, sample i lies at about start + i * stride, in cells.
class RayInGrid {
 public:
  // The grid's coordinates are x - anchor. The ray's samples lie at first_t + i * step.
  RayInGrid(const Grid& grid, const float* origin, const float* direction, const float* anchor, double first_t,
            double step)
      : grid_(grid), anchor_(anchor) {
    for (int axis = 0; axis < 3; ++axis) {
      const double x = origin[axis] + first_t * direction[axis] - anchor[axis];
      start_[axis] = (x - grid.low[axis]) * grid.scale[axis];
      per_cell_[axis] = 1 / (step * direction[axis] * grid.scale[axis]);
    }
  }

  // Narrows the samples [first, last) to those that may lie in the box. A NaN narrows nothing.
  void Clip(int64_t* first, int64_t* last) const {
    auto enter = static_cast<double>(*first), leave = static_cast<double>(*last);
    for (int axis = 0; axis < 3; ++axis) {
      const double low = (-kSlack - start_[axis]) * per_cell_[axis];
      const double high = (static_cast<double>(grid_.resolution) + kSlack - start_[axis]) * per_cell_[axis];
      enter = std::max(enter, std::min(low, high));
      leave = std::min(leave, std::max(low, high));
    }
    *last = enter <= leave ? std::min(*last, static_cast<int64_t>(leave) + 1) : *first;
    if (enter <= leave) *first = static_cast<int64_t>(enter);
  }

  // i where sample i, at x, is occupied; otherwise the next one, at most about `last`, that may be.
  int64_t Next(int64_t i, int64_t last, const float x[3]) const {
    int64_t corner[3];
    for (int axis = 0; axis < 3; ++axis) {
      const float cell = ((x[axis] - anchor_[axis]) - grid_.low[axis]) * grid_.scale[axis];
      if (!(cell >= 0 && cell < static_cast<float>(grid_.resolution))) return i + 1;
      corner[axis] = static_cast<int64_t>(cell);
    }
    if (grid_.occupied[(corner[0] * grid_.resolution + corner[1]) * grid_.resolution + corner[2]]) return i;
    auto exit = static_cast<double>(last);
    for (int axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(per_cell_[axis])) continue;
      const double wall = static_cast<double>(corner[axis]) + (per_cell_[axis] > 0 ? 1 - kSlack : kSlack);
      exit = std::min(exit, (wall - start_[axis]) * per_cell_[axis]);
    }
    return static_cast<int64_t>(std::max(exit, static_cast<double>(i))) + 1;
  }

 private:
  const Grid& grid_;
  const float* anchor_;
  double start_[3];
  double per_cell_[3];  // 1 / stride: negative on the way down, infinite where the axis stands still
};

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
  at::Tensor anchors;
  std::vector<Grid> grids{Grid(grid)};
  if (local != nullptr) {
    CheckShape(rays.anchor, {count, 3}, "anchor");
    anchors = Floats(rays.anchor, "anchor");
    grids.emplace_back(*local);
  }
  const float* const anchor = anchors.defined() ? anchors.data_ptr<float>() : nullptr;
  const float no_anchor[3] = {};
  // Rounded as MarchCandidates does it.
  const auto from = static_cast<float>(near);
  const float step = (static_cast<float>(far) - from) / static_cast<float>(steps);
  const auto position = [&](int64_t ray, int64_t i) { return from + (static_cast<float>(i) + jitter[ray]) * step; };

  const at::Tensor kept = torch::empty({count, steps}, torch::kInt32);  // the steps of each ray, from the left
  PackedSamples samples;
  samples.offsets = torch::zeros({count + 1}, torch::kInt64);
  int32_t* const kept_steps = kept.data_ptr<int32_t>();
  int64_t* const offsets = samples.offsets.data_ptr<int64_t>();
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t ray = begin; ray < end; ++ray) {
      const float *const o = origin + 3 * ray, *const d = direction + 3 * ray;
      int64_t i = 0, last = steps;
      c10::SmallVector<RayInGrid, 2> views;
      for (const Grid& one : grids) {
        views.emplace_back(one, o, d, views.empty() ? no_anchor : anchor + 3 * ray, position(ray, 0), step);
        views.back().Clip(&i, &last);
      }
      int32_t* own = kept_steps + ray * steps;
      while (i < last) {
        const float t = position(ray, i);
        const float x[3] = {o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]};
        int64_t next = i;
        for (const RayInGrid& view : views) {
          next = view.Next(i, last, x);
          if (next != i) break;
        }
        if (next == i) *own++ = static_cast<int32_t>(next++);
        i = next;
      }
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
        t_out[s] = position(ray, *own++);
      }
    }
  });
  return samples;
}

}  // namespace editnerf
