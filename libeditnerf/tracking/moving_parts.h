// The parts of a scene that move, each as one rigid body with its points, strongest first.
#pragma once

#include <vector>

#include "libeditnerf/tracking/part_growth.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

struct MovingPart {
  RigidPart body;
  double range = 0;   // pixels at 320 wide: how far its points go, seen from their median place
  double weight = 0;  // pixels observed times range
};

struct MovingParts {
  std::vector<FlowTrack> tracks;
  std::vector<MovingPart> parts;  // heaviest first; parts that move as a heavier one does are left out
};

// Parts are grown from where most tracks lie that belong to none yet, until several in a row are light beside the
// heaviest. near, far: scene units, as for TrackMovingPixels. Throws Interrupted.
MovingParts FindMovingParts(const Clip& clip, const MotionEvidence& motion, DirectFlows* direct, double near,
                            double far);

// Whether a part that lighter tracks gave moves as the other does: carried along by it, its points stay nearer to where
// they are than half their range.
bool MovesAs(const Clip& clip, const RigidPart& part, const RigidPart& other);

// Distances of the part's points wherever they are seen, away from its edge.
DepthTargets PartDepths(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part);

}  // namespace editnerf
