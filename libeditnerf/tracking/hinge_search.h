// A part on a hinge in frames that lost it: with the hinge known, one angle is all that is missing there.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/part_hinge.h"
#include "libeditnerf/tracking/rigid_part.h"

namespace editnerf {

// Counts in every frame that sees the part the points that look there as they should (point_patch.h), where the part
// has them. In frames with fewer than half of what is usual, and in those that do not see it, it is looked for at all
// angles that the hinge has in the others, and somewhat beyond, from the known frames outwards. It is put where most
// points are found, those at an angle near to that of the frame beside it counting for more; where hardly any are found
// at all, the frame no longer counts as one that sees it, and one that did not comes to where half of what is usual is
// found. Returns in how many frames the part was put elsewhere.
int64_t FindLostAngles(const Clip& clip, const std::vector<FlowTrack>& tracks, RigidPart* part);

}  // namespace editnerf
