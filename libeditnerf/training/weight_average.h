// The mean of a field's weights over its last steps. Steps that are large enough to go on learning leave the weights
// scattered about a better place than any of them; smaller steps would quiet that, and learn less.
//
// Polynomial-decay averaging (Shamir and Zhang, ICML 2013, section 4): after n weights
//   mean_n = mean_(n-1) + (eta + 1) / (eta + n) (w_n - mean_(n-1)),   eta = 8,
// so that about the last fifth of all steps counts, whenever training ends.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/training/saved_state.h"

namespace editnerf {

class WeightAverage {
 public:
  // `weights`, by unique names, are the field's own tensors.
  explicit WeightAverage(std::vector<std::pair<std::string, torch::Tensor>> weights);

  // The weights count as they are now. Not while the mean is shown.
  void Add();
  // Forgets all that was added, where training went back.
  void Restart();

  // The mean in the place of the weights, and back. Nothing happens where nothing was added, or the mean is not
  // finite: that is forgotten.
  void Show();
  void Hide();

  // While the mean is shown: the weights behind it under "weights.NAME", and "count". Empty where nothing was added.
  SavedState State() const;
  // For a field that holds such a mean: takes the weights back, and the mean from the field. Throws CheckpointError
  // naming what is missing or has another shape.
  void LoadState(const SavedState& state);

 private:
  void Exchange();

  std::vector<std::pair<std::string, torch::Tensor>> weights_;
  std::vector<torch::Tensor> others_;  // the mean, or while it is shown the weights
  int64_t count_ = 0;
  bool shown_ = false;
};

}  // namespace editnerf
