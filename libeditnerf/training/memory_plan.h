// How much memory an optimisation takes, from sizes alone. What a whole stage takes: pipeline/stage_memory.h.
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

// What a loaded scene holds: images and ground truth.
MemoryPlan PlanScene(const Scene& scene);

// The field as it is between steps, and while it renders: parameters, gradients and occupancy grids.
MemoryPlan PlanField(const Run& run);

// Of training `run` on `scene`, as Trainer does it: images, ground truth, the field with gradients, Adam's moments and
// the copy to roll back to, occupancy grids, and what a step holds for its samples. The last is exact for the fused
// pass once every step takes StageConfig::samples_per_step samples, and an estimate of LibTorch's graph elsewhere.
// LibTorch itself (about 200 MiB) is not in it, and neither is what supervises the field beside the images.
MemoryPlan PlanMemory(const Run& run, const Scene& scene);

// "120 MiB: images 21, field 3.2, ..."; parts under 0.1 MiB are not named.
std::string SizesText(const MemoryPlan& plan);

// "memory beside LibTorch: 120 MiB: images 21, ..."
std::string ToText(const MemoryPlan& plan);

}  // namespace editnerf
