// The kind of motion of a part, chosen by its looks.
//
// What moves in one way only, on a rail or on a hinge, can also be explained by motion that is freer, and better, as
// freedom takes up the errors of tracks: chained ones drift, and so do patches, by a fraction of a pixel that a free
// part makes five of. So every kind is followed by the part's looks (part_alignment.h) for itself, and the simplest
// that finds as much of the part about as well is kept.
#pragma once

#include <vector>

#include "libeditnerf/tracking/part_solver.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {

// The part without the drift of chained flow. The tracks that its points follow then are appended to `tracks`.
RigidPart FollowByLooks(const Clip& clip, const RigidPart& part, const DepthRange& range,
                        std::vector<FlowTrack>* tracks);

}  // namespace editnerf
