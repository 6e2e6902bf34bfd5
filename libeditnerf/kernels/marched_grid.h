// What marching walks through (ray_march.h): grids of bits, the frames they lie in, and the steps of a ray.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libeditnerf/kernels/ray_march.h"

namespace editnerf {

// A grid's bits, ready for look-ups. Throws ShapeError for tensors of other shapes, types or devices; reads the bits'
// memory, which must outlive this.
struct MarchedGrid {
  const bool* occupied = nullptr;  // [max(resolution^3, 4)]: four can be read at a time
  int64_t resolution = 0;
  float low[3], scale[3];  // from scene units to cells

  MarchedGrid() = default;
  explicit MarchedGrid(const OccupancyBits& bits);
};

// A grid over turn (x - anchor). What the pointers point to must outlive this.
struct GridView {
  const MarchedGrid* grid = nullptr;  // nullptr: none
  const float* anchor = nullptr;      // [3]; nullptr: 0
  const float* turn = nullptr;        // [3, 3] by rows; nullptr: the identity
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

}  // namespace editnerf
