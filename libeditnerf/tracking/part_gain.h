// How much a moving part explains that standing still would not: what a fit is worth.
#pragma once

#include <vector>

#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/rigid_part.h"
#include "libeditnerf/tracking/stillness.h"

namespace editnerf {

// Over static points, the best for each of the part's tracks, in costs (stillness.h).
struct PartGain {
  double all = 0;  // summed over all pixels that were seen
  // Of one pixel where the part moves: the mean over all, as fits to slipped tracks gain little in many places. Of a
  // part that rests nearly all the time it is that of the frames in which it gains most, as on the mean it gains as
  // little. What tells it from slips is that these come one by one: there is no time at which nearly all of it is far
  // from where it would have to stand still.
  double moving = 0;
};

PartGain GainOverStillness(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                           const DepthRange& range);

}  // namespace editnerf
