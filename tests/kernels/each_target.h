// Every instruction set of this machine that this build has kernels for.
#pragma once

#include <hwy/targets.h>

#include "tests/catch.h"

namespace editnerf {

// Runs the body once for each, with the kernels of that instruction set.
template <class Body>
void ForEachTarget(const Body& body) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    body();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace editnerf
