// Keeps NaN and infinity out of the weights: looks at every loss term and every gradient of a step before the optimiser
// does, and says whether to take the step, skip it, or go back to the last good state.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace editnerf {

using NamedTensors = std::vector<std::pair<std::string, torch::Tensor>>;

struct StepVerdict {
  bool take = true;            // all finite
  bool roll_back = false;      // too many steps in a row were not
  std::string not_finite;      // "motion, gradient of warp.trunk.0.weight"; empty if `take`
  std::vector<double> losses;  // the terms' values in their order, for the log
  double gradient_norm = 0;    // over all parameters
};

class StepGuard {
 public:
  // Asks for a roll back at every `max_failures`-th failure in a row.
  explicit StepGuard(int64_t max_failures = 10) : max_failures_(max_failures) {}

  // Scalar loss terms and the parameters, after backward and before the optimiser's step; parameters without a gradient
  // are passed over. One transfer from the device in all.
  StepVerdict Check(const NamedTensors& losses, const NamedTensors& parameters);

  int64_t skipped() const { return skipped_; }
  const std::map<std::string, int64_t>& failures() const { return failures_; }  // by name of the loss term or parameter

 private:
  int64_t max_failures_;
  int64_t in_a_row_ = 0;
  int64_t skipped_ = 0;
  std::map<std::string, int64_t> failures_;
};

}  // namespace editnerf
