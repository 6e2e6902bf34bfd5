// Keeps NaN and infinity out of the weights: looks at every loss term and every gradient of a step before the optimiser
// does, and says whether to take the step, skip it, or go back to the last good state.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace editnerf {

using NamedTensors = std::vector<std::pair<std::string, torch::Tensor>>;
using NamedValues = std::vector<std::pair<std::string, double>>;

struct StepVerdict {
  bool take = true;                     // all finite
  bool roll_back = false;               // too many steps in a row were not
  std::vector<std::string> not_finite;  // "motion", "gradient of warp.trunk.0.weight"; empty if `take`
  NamedValues losses;                   // the terms in their order
  NamedValues gradients;                // norms of the parameters' gradients
  double gradient_norm = 0;             // over all parameters
};

class StepGuard {
 public:
  // Asks for a roll back at every `max_failures`-th failure in a row.
  explicit StepGuard(int64_t max_failures = 10) : max_failures_(max_failures) {}

  // Scalar loss terms and the parameters, after backward and before the optimiser's step; parameters without a gradient
  // are passed over. One transfer from the device in all. A float32 gradient whose square is beyond float32 counts as
  // not finite: Adam's second moment would never be finite again.
  StepVerdict Check(const NamedTensors& losses, const NamedTensors& parameters);

  int64_t failures_in_a_row() const { return in_a_row_; }  // since the last step taken or roll back

 private:
  int64_t max_failures_;
  int64_t in_a_row_ = 0;
};

// "motion, gradient of warp.trunk.0.weight and 12 more".
std::string ListOf(const std::vector<std::string>& names, size_t most = 4);

}  // namespace editnerf
