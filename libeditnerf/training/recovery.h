// Going back to the last good state where steps fail one after the other, and giving up where that does not help.
#pragma once

#include <cstdint>
#include <string>

#include "libeditnerf/training/good_state.h"
#include "libeditnerf/training/step_guard.h"

namespace editnerf {

class Recovery {
 public:
  // `advice` ends the messages of errors: what the user can do.
  explicit Recovery(std::string advice) : advice_(std::move(advice)) {}

  // After gradients that were finite, before the optimiser's step. Keeps the weights every few hundred steps.
  void StepIsGood(const Run& run, const Adam& adam);

  // Throws Error where the run has failed before and has reached no new good state since, or never had one: who fails
  // again at once would fail for ever.
  void GoBack(const std::string& not_finite, Run* run, Adam* adam);

  // The end of a run or a checkpoint must not stand on weights that no step has looked at: goes back unless they are
  // finite, and in any case where the last steps had failed.
  void MakeFit(bool last_steps_failed, Run* run, Adam* adam);

 private:
  void Restore(Run* run, Adam* adam);

  std::string advice_;
  GoodState good_;
  int64_t next_keep_ = 0;     // step
  bool tried_again_ = false;  // from `good_`
};

}  // namespace editnerf
