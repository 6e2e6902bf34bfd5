// A part on a hinge in frames that do not see what it was found by: it shows another side there, or only its edge. With
// the hinge known, one number is all that optical flow has to tell of it from a frame to the next, and the little that
// is right of it where a part turns fast is enough for that.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/rigid_part.h"

namespace editnerf {

// Sets the poses of frames that do not see the part, from those that do outwards: each has the angle to which most of
// the flow where the part lies carries it. Between two frames that see it, it is followed from both, and where the two
// ways never meet - something covers it, whose flow that is - the poses stay as they are. Returns the frames it was
// followed in.
std::vector<int64_t> FollowFlowOnHinge(const Clip& clip, RigidPart* part);

}  // namespace editnerf
