// Which of a field's parameters learn together, and how.
#pragma once

#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/training/adam.h"

namespace editnerf {

// Networks, the networks that shape space, hash tables, per-frame codes, key points and the turns of their parts, each
// at the stage's rate for it; the last two settle.
std::vector<AdamGroup> AdamGroupsFor(const HyperspaceField& field, const StageConfig& stage);

AdamOptions AdamOptionsFor(const Config& config);

}  // namespace editnerf
