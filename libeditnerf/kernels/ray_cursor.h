// Walks one ray through occupancy grids, sample by sample: the inside of MarchRays (ray_march.h), which has the rules,
// for those who stop early and want no list.
#pragma once

#include <cstdint>

#include "libeditnerf/kernels/marched_grid.h"
#include "libeditnerf/kernels/occupied_samples.h"

namespace editnerf {

class RayCursor {
 public:
  RayCursor() = default;
  // `local` may be without a grid. What is pointed to must outlive this. Samples before number `first` are passed over.
  RayCursor(const MarchedGrid& grid, const GridView& local, const MarchedSteps& steps, const float* origin,
            const float* direction, float jitter, int64_t first = 0);

  // The number of the next occupied sample, with its distance and position; -1 where there is none.
  int64_t Next(float* t, float x[3]);

 private:
  const MarchedSteps* steps_ = nullptr;
  RayInGrids ray_;
  int64_t next_ = 0, last_ = 0;  // samples that are not looked up yet
  int64_t first_ = 0;            // sample of bit 0 of found_
  uint32_t found_ = 0;           // occupied samples that were not asked for yet
};

}  // namespace editnerf
