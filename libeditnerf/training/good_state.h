// What training goes back to when it fails: weights, optimiser and occupancy of a moment when all was well. Going back
// with the weights alone would leave moments and grids that the failure has made.
#pragma once

#include <cstdint>

#include "libeditnerf/training/adam.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

class GoodState {
 public:
  // Copies everything; memory is taken once.
  void Keep(const Run& run, const Adam& adam);

  // Copies it back, in place: whatever was derived from a tensor sees by its version that it has changed. Keep first.
  void Restore(Run* run, Adam* adam) const;

  bool empty() const { return tensors_.empty(); }
  int64_t step() const { return step_; }  // of the run when it was kept

 private:
  SavedState tensors_;
  int64_t step_ = 0;
};

// Whether all weights are finite.
bool HasFiniteWeights(const HyperspaceField& field);

}  // namespace editnerf
