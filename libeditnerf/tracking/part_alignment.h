// A part's points, followed by their looks instead of by flow that is chained from frame to frame.
//
// Chained flow drifts: by pixels over a hundred frames, slowly, and alike for all points that lie beside each other. A
// part that is fitted to such tracks drifts with them, as nothing ties what is seen now to what was seen long ago. So
// each point gets one patch (point_patch.h), of one frame, and every other frame is aligned with that: errors then do
// not add up. How the patch has turned and shrunk since follows from the cameras and the part's pose.
#pragma once

#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/rigid_part.h"

namespace editnerf {

// Where a point of the part lies in all frames that show what the middle of its longest track shows; a track for each
// run of such frames, the longest first. Empty where the patch has no corner to hold on to.
std::vector<FlowTrack> AlignPoint(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                                  const PartPoint& point);

}  // namespace editnerf
