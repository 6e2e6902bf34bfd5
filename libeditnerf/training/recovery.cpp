#include "libeditnerf/training/recovery.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"

namespace editnerf {
namespace {

constexpr int64_t kKeepEvery = 500;  // steps

}  // namespace

void Recovery::StepIsGood(const Run& run, const Adam& adam) {
  if (!good_.empty() && run.counters.step < next_keep_) return;
  // Finite gradients do not prove it: a state whose key points are not finite shows nothing, and no loss sees them.
  if (!HasFiniteWeights(*run.field)) return;
  good_.Keep(run, adam);
  next_keep_ = run.counters.step + kKeepEvery;
  tried_again_ = false;
}

void Recovery::GoBack(const std::string& not_finite, Run* run, Adam* adam) {
  if (good_.empty()) Throw<Error>("training fails from its first step on: not finite: {}; {}", not_finite, advice_);
  if (tried_again_) {
    Throw<Error>("training diverges: at step {}, after going back to the state of step {}, again not finite: {}; {}",
                 run->counters.step, good_.step(), not_finite, advice_);
  }
  Restore(run, adam);
  tried_again_ = true;
}

void Recovery::MakeFit(bool last_steps_failed, Run* run, Adam* adam) {
  if (!last_steps_failed && HasFiniteWeights(*run->field)) return;
  if (good_.empty()) GoBack("all of it", run, adam);  // throws
  Restore(run, adam);
}

void Recovery::Restore(Run* run, Adam* adam) {
  LogWarning("going back to weights, optimiser and occupancy of step {}", good_.step());
  good_.Restore(run, adam);
  next_keep_ = run->counters.step + kKeepEvery;
  ++run->counters.rolled_back;
}

}  // namespace editnerf
