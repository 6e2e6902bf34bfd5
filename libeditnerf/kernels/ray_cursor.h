// Walks one ray through occupancy grids, sample by sample: the inside of MarchRays (ray_march.h), which has the rules,
// for those who stop early and want no list.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libeditnerf/kernels/ray_march.h"

namespace editnerf {

// A grid's bits, ready for look-ups. Throws ShapeError for tensors of other shapes, types or devices; reads the bits'
// memory, which must outlive this.
struct MarchedGrid {
  const bool* occupied = nullptr;
  int64_t resolution = 0;
  float low[3], scale[3];  // from scene units to cells

  MarchedGrid() = default;
  explicit MarchedGrid(const OccupancyBits& bits);
};

// A grid over turn (x - anchor). What the pointers point to must outlive this.
struct LocalView {
  const MarchedGrid* grid = nullptr;  // nullptr: none
  const float* anchor = nullptr;      // [3]; nullptr: 0
  const float* turn = nullptr;        // [3, 3] by rows; nullptr: the identity

  void Apply(const float x[3], float local[3]) const {
    float apart[3] = {x[0], x[1], x[2]};
    for (int axis = 0; anchor != nullptr && axis < 3; ++axis) apart[axis] -= anchor[axis];
    for (int own = 0; own < 3; ++own) {
      local[own] = turn == nullptr
                       ? apart[own]
                       : turn[3 * own] * apart[0] + turn[3 * own + 1] * apart[1] + turn[3 * own + 2] * apart[2];
    }
  }
};

// One ray in one grid: along an axis, sample i lies at about start + i / per_cell, in cells.
class RayInGrid {
 public:
  RayInGrid() = default;
  // The ray's samples lie at first_t + i * step.
  RayInGrid(const LocalView& view, const float* origin, const float* direction, double first_t, double step);

  // Narrows the samples [first, last) to those that may lie in the box. A NaN narrows nothing.
  void Clip(int64_t* first, int64_t* last) const;

  // i where sample i, at x, is occupied; otherwise the next one, at most about `last`, that may be.
  int64_t Next(int64_t i, int64_t last, const float x[3]) const;

 private:
  // Cells by which walls are moved so that less is skipped: far more than rounding, so that every sample that may lie
  // on either side of a wall is looked up.
  static constexpr double kSlack = 1e-3;

  LocalView view_;
  double start_[3];
  double per_cell_[3];  // negative on the way down, infinite where the axis stands still
};

// So many samples before the distance at which a ray is said to begin are looked at all the same.
constexpr int64_t kSamplesBeforeStart = 2;

// Equal steps: sample i of a ray lies at near + (i + jitter) * step, rounded as MarchCandidates does it.
struct MarchedSteps {
  float near = 0, step = 0;
  int64_t count = 0;

  MarchedSteps() = default;
  MarchedSteps(double from, double to, int64_t steps)
      : near(static_cast<float>(from)),
        step((static_cast<float>(to) - static_cast<float>(from)) / static_cast<float>(steps)),
        count(steps) {}

  // The first sample at or behind t, at most `count`.
  int64_t SampleBehind(float t, float jitter) const {
    const float i = std::ceil((t - near) / step - jitter);
    return i > 0 ? static_cast<int64_t>(std::min(i, static_cast<float>(count))) : 0;
  }
  float Position(int64_t i, float jitter) const { return near + (static_cast<float>(i) + jitter) * step; }
};

class RayCursor {
 public:
  RayCursor() = default;
  // `local` may be without a grid. What is pointed to must outlive this. Samples before number `first` are passed over.
  RayCursor(const MarchedGrid& grid, const LocalView& local, const MarchedSteps& steps, const float* origin,
            const float* direction, float jitter, int64_t first = 0);

  // The number of the next occupied sample, with its distance and position; -1 where there is none.
  int64_t Next(float* t, float x[3]);

 private:
  const MarchedSteps* steps_ = nullptr;
  const float *origin_ = nullptr, *direction_ = nullptr;
  float jitter_ = 0;
  RayInGrid views_[2];
  int num_views_ = 0;
  int64_t next_ = 0, last_ = 0;
};

}  // namespace editnerf
