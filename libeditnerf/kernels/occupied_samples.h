// Which of some consecutive samples of a ray lie in occupied cells: the look-ups of marching, a vector at a time.
#pragma once

#include <cstdint>

#include "libeditnerf/kernels/marched_grid.h"

namespace editnerf {

// Samples that are looked up at a time.
constexpr int64_t kLookedUp = 32;

// A ray and the grids that all have to be occupied, `num_views` of them. What is pointed to must outlive this.
struct RayInGrids {
  GridView views[2];
  int num_views = 0;
  const float *origin = nullptr, *direction = nullptr;  // [3]
  float jitter = 0;
};

// Bit k: whether sample first + k lies in occupied cells, rounded as one sample by itself is. NaN and what lies outside
// a box does not.
uint32_t OccupiedSamples(const RayInGrids& ray, const MarchedSteps& steps, int64_t first);

}  // namespace editnerf
