// Adam (Kingma and Ba, ICLR 2015) over named parameters, with bias correction.
//
// Beside LibTorch's own: state that is saved by name, one fused pass per parameter on the CPU, and tables whose
// untouched entries (gradient exactly 0) are left alone, moments included, as is usual for hash encodings.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <string>
#include <vector>

#include "libeditnerf/training/saved_state.h"

namespace editnerf {

struct AdamGroup {
  std::vector<std::pair<std::string, torch::Tensor>> parameters;  // unique names across groups
  double learning_rate_factor = 1;                                // multiplies the learning rate of each step
  bool skip_untouched = false;  // leave entries with zero gradient alone; Step may clear the gradients that it used
  // After each step everything here is multiplied by 1 - decay * learning rate, untouched or not (decoupled weight
  // decay, Loshchilov and Hutter, ICLR 2019).
  double decay = 0;
  // Steps after which the rate falls as this over the number of steps, so that what the noise of gradients adds up to
  // stays bounded (Robbins and Monro, 1951); 0: never.
  int64_t settle_after = 0;
};

struct AdamOptions {
  double beta1 = 0.9, beta2 = 0.99;
  double epsilon = 1e-15;
};

class Adam {
 public:
  Adam(const std::vector<AdamGroup>& groups, const AdamOptions& options);

  // Applies the gradients of all parameters that have one.
  void Step(double learning_rate);
  // Tables keep their gradient's memory, all zero; other parameters lose theirs.
  void ZeroGrad();

  // All parameters by name, for guards.
  std::vector<std::pair<std::string, torch::Tensor>> parameters() const;

  // Moments and step count under "first.NAME", "second.NAME" and "steps". Load throws CheckpointError naming what is
  // missing or has another shape.
  SavedState State() const;
  void LoadState(const SavedState& state);

 private:
  struct Slot {
    std::string name;
    torch::Tensor parameter, first, second;
    double factor;
    bool skip_untouched;
    double decay;
    int64_t settle_after;
    bool cleared = false;  // by Step
  };

  std::vector<Slot> slots_;
  AdamOptions options_;
  int64_t steps_ = 0;
};

}  // namespace editnerf
