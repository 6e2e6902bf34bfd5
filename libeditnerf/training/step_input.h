// All that one step of training draws at random, before anything is computed from it; and a step on disk, to be
// computed again (step_replay.h).
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "libeditnerf/render/ray_batch.h"
#include "libeditnerf/training/key_point_supervision.h"
#include "libeditnerf/training/run.h"
#include "libeditnerf/training/training_rays.h"

namespace editnerf {

struct StepInput {
  RayTargets batch;
  RayOptions options;
  torch::Tensor state;      // [R] int64, rows of the frames' states and, behind them, of `drawn`
  torch::Tensor drawn;      // [batch.drawn, N, 3], key points of the batch's last rays; undefined without any
  torch::Tensor generator;  // state of LibTorch's CPU generator, where samples along the rays are drawn from it later
};

struct StoredStep {
  Run run;  // weights and occupancy as they were before the step, finite or not
  StepInput input;
  std::optional<KeyPointSupervision> supervision;
};

// Writes a run folder (run.h) whose checkpoint holds the step too, as extra tensors "step.NAME" and "supervision.NAME".
void SaveStep(const Run& run, const StepInput& input, const std::optional<KeyPointSupervision>& supervision,
              const std::filesystem::path& folder);

// Throws CheckpointError naming the file and what is missing.
StoredStep LoadStep(const std::filesystem::path& folder, torch::Device device);

}  // namespace editnerf
