// How far a rigid part is from the cameras: the one number that its images do not tell.
//
// At s times its distance a part would have to follow the camera to look as it does, in one direction or the other. So
// where the camera moves by itself, the right distance is that at which the part has the shortest way to go, as a share
// of the distance: of the way itself, what is its own shrinks as it comes nearer, and what moves all the time would
// come out too near. The sum of lengths, not of squares, because parts rest at times (compare Ozden et al., ICCV 2004,
// and Park et al., ECCV 2010). Where the camera hardly moves beside the part that says little, and depth maps have
// their say too: they paint a moving part onto the background often enough, but where they err they do not agree with
// each other.
#pragma once

#include <optional>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/rigid_part.h"

namespace editnerf {

// The part at s times the distance from every camera: the images are the same.
RigidPart ScaledFromCameras(const Clip& clip, const RigidPart& part, double s);

// The s, between 1 / 2.2 and 2.2, at which the part's points go the shortest way, over s, and many depth maps agree.
double ShortestWay(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part);

// The s, within a quarter of 1, at which the part stands still where it rests, and only there: of its ways over 2 to 16
// frames those count that are shorter than half a pixel, whatever the others are. Sharper than the shortest way, whose
// moving frames have a say as well. Empty where the part hardly rests while the camera moves.
std::optional<double> RestingScale(const Clip& clip, const RigidPart& part);

}  // namespace editnerf
