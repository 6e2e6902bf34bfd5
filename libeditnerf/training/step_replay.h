// A step that training skipped, computed again from what it left in RUN/bad_steps (train.dump_bad_steps).
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/training/step_guard.h"

namespace editnerf {

struct StepReplay {
  int64_t step = 0;
  std::vector<std::string> weights;  // those that were not finite before the step
  StepVerdict verdict;
};

// Throws CheckpointError where no step lies in the folder. The same bits as in training with as many threads.
StepReplay ReplayStep(const std::filesystem::path& folder, torch::Device device);

// Every loss term, the norm of every gradient, and what is not finite.
std::string ToText(const StepReplay& replay);

}  // namespace editnerf
