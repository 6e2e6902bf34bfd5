// How much memory a stage's training takes, from sizes alone: printed before it starts.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/training/run.h"

namespace editnerf {

struct MemoryPlan {
  std::vector<std::pair<std::string, int64_t>> parts;  // bytes
  int64_t Total() const;
};

// Of training `run` on `scene`, as Trainer does it: images, ground truth, the field with gradients, Adam's moments and
// the copy to roll back to, occupancy grids, and what a step holds for its samples. The last is exact for the fused
// pass once every step takes StageConfig::samples_per_step samples, and an estimate of LibTorch's graph elsewhere.
// LibTorch itself (about 200 MB) is not in it.
MemoryPlan PlanMemory(const Run& run, const Scene& scene);

// "memory: 120.3 MB: images 20.7, ..."
std::string ToText(const MemoryPlan& plan);

}  // namespace editnerf
