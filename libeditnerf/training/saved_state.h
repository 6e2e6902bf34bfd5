// What a checkpoint keeps beside the weights, so that training goes on as if it had not stopped.
#pragma once

#include <torch/types.h>

#include <map>
#include <string>

namespace editnerf {

using SavedState = std::map<std::string, torch::Tensor>;

// Copies `key` into `target`, in place; throws CheckpointError if it is missing or has another shape.
void LoadInto(const SavedState& state, const std::string& key, const torch::Tensor& target);

// What lies under `prefix`, by the rest of its names.
SavedState Under(const std::string& prefix, const SavedState& state);

// Puts `part` under `prefix`.
void PutUnder(const std::string& prefix, const SavedState& part, SavedState* state);

}  // namespace editnerf
