// What a stage holds in memory, phase by phase, from sizes alone: logged before it computes anything.
//
// What only the stage itself finds out is bounded or estimated:
//   places of known depth   as many as are looked for, one in 36 pixels at 320 wide
//   components left to auto as if they were there; ambient coordinates as while undecided
//   optical flow            what its search takes while it runs is an estimate, for RAFT a rough one
// Short trainings that decide about such components hold no more than the optimisation, and are not listed.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/pipeline/stages.h"
#include "libeditnerf/training/memory_plan.h"

namespace editnerf {

struct MemoryPhase {
  std::string name;  // "optical flow"
  MemoryPlan plan;
};

struct StageMemory {
  std::vector<MemoryPhase> phases;  // in the order of time, at least one

  const MemoryPhase& Largest() const;
};

// Of RunPretraining with `config` on `device`. Leaves the random generators alone, as the next does.
StageMemory PlanPretraining(const Config& config, const Scene& scene, torch::Device device);

// Of RunTraining. Where `folder` is given, maps and known places of `detected` are still to be read from there.
StageMemory PlanTraining(const Config& config, const Scene& scene, torch::Device device,
                         const DetectedKeyPoints& detected, const std::filesystem::path& folder = {});

// The largest phase, and a line for each:
//   memory: at most 857 MiB beside LibTorch, for static depth
//   memory for optical flow: 655 MiB: images 79, ...
std::vector<std::string> ToText(const StageMemory& memory);

}  // namespace editnerf
