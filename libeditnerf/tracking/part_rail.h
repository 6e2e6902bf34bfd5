// A rigid part on a rail: it does not turn, and goes along one straight line that stands still in the scene. Drawers,
// lifts and sliding doors move so. Where a rail explains the tracks it says what free motion leaves open: how far the
// part is, as at any other distance it would have to follow the camera, and the slow drift across the line that free
// motion makes of patches which slide by a fraction of a pixel while the camera goes around.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

struct Rail {
  Vec3 along;                 // a unit vector
  std::vector<double> shift;  // T, scene units from the reference frame
};

// The rail nearest to the part's translations in the given frames; empty where they hardly differ.
std::optional<Rail> NearestRail(const RigidPart& part, const std::vector<int64_t>& frames);

// Sets the poses of the given frames to those of the rail.
void SetPoses(const Rail& rail, const std::vector<int64_t>& frames, RigidPart* part);

// As SolveHinge (part_hinge.h): the rail and all points by least squares over the given frames, in time order.
std::optional<double> SolveRail(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, const std::vector<int64_t>& frames, Rail* rail,
                                RigidPart* part);

// Between frames that see the part it moves steadily in those that do not; before the first and behind the last it
// stays.
void FillShifts(RigidPart* part);

}  // namespace editnerf
