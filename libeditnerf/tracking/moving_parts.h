// The parts of a scene that move, each as one rigid body with its points, strongest first.
#pragma once

#include <vector>

#include "libeditnerf/tracking/part_growth.h"
#include "libeditnerf/tracking/still_points.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

struct MovingPart {
  RigidPart body;
  double range = 0;   // pixels at 320 wide: how far its points go, seen from their median place
  double gain = 0;    // by how much it explains its pixels better than static points do: costs (stillness.h), summed
  double weight = 0;  // the gain times the square of that of one pixel where the part moves (part_gain.h)
};

struct MovingParts {
  std::vector<FlowTrack> tracks;
  std::vector<MovingPart> parts;  // heaviest first; parts that move as a heavier one does are left out
};

// Parts are grown from where standing still explains least of the tracks that belong to none yet, until several in a
// row are light beside the heaviest. range: scene units, as for TrackMovingPixels. Throws Interrupted.
MovingParts FindMovingParts(const Clip& clip, const MotionEvidence& motion, DirectFlows* direct,
                            const DepthRange& range);

// Whether a part moves as the other does, judged from a few frames to the next: in most places in which it moves at
// all, the other would carry it along about as far, there or at the other's distance. So fragments of one part, and
// what flow drags along at its edge, are told from parts of their own, however much their fits have drifted apart.
bool MovesAs(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part, const RigidPart& other);

// Distances of the part's points wherever they are seen, away from its edge. key_point: that which the part carries, or
// kNotCarried.
DepthTargets PartDepths(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                        int64_t key_point);

}  // namespace editnerf
