// A rigid part turned inside out: the other of the two that its images can hardly tell apart.
//
// Seen from afar, a part looks like its mirror image in depth that turns the other way (Necker's reversal). What tells
// them apart is perspective, and that a part rests at times: its mirror image would have to turn with the camera.
#pragma once

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/rigid_part.h"

namespace editnerf {

// Mirrored in every frame through the plane across the view onto the part's centre, which stays where it is. Twice is
// the part again.
RigidPart InsideOut(const Clip& clip, const RigidPart& part);

}  // namespace editnerf
