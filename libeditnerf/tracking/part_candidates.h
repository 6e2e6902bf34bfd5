// Key points on rigid parts: one on each, carried by its part through every frame, seen or not.
#pragma once

#include <vector>

#include "libeditnerf/tracking/candidates.h"
#include "libeditnerf/tracking/moving_parts.h"

namespace editnerf {

// One candidate a part, in their order. The point is one that goes about as far as any of its part, away from the
// part's edge and seen for long: a lid's lies far from its hinge, and tells how far it is open.
std::vector<Candidate> PartCandidates(const Clip& clip, const MovingParts& moving);

}  // namespace editnerf
