// A rigid part on a hinge: one axis that stands still in the scene, and an angle for each frame. Doors, lids, levers
// and limbs move so. Where a hinge explains the tracks it says what free motion leaves open: the turns, which differ
// little from those of a flatter part that turns more, and the distance, as at any other the axis would have to follow
// the camera.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

struct Hinge {
  Vec3 axis;                  // a unit vector
  Vec3 through;               // a point on it, scene units
  std::vector<double> angle;  // T, radians from the reference frame
};

// The hinge nearest to the part's poses in the given frames; empty where they hardly turn.
std::optional<Hinge> NearestHinge(const RigidPart& part, const std::vector<int64_t>& frames);

// Where what lies at `position` in the reference frame comes to at an angle, radians.
Vec3 PlaceAt(const Hinge& hinge, double angle, const Vec3& position);

// Sets the poses of the given frames to those of the hinge.
void SetPoses(const Hinge& hinge, const std::vector<int64_t>& frames, RigidPart* part);

// The hinge and all points by least squares over the given frames, in time order, beginning from those given; then the
// part's centre is that of its points. Returns the cost that is left, comparable among starts from the same centre,
// tracks and frames; empty where nothing finite comes out, and then all is as it was.
std::optional<double> SolveHinge(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                 const PartSolverOptions& options, const std::vector<int64_t>& frames, Hinge* hinge,
                                 RigidPart* part);

// Of a part on a hinge: sets the poses of frames that do not see it (FillBetween, rigid_part.h).
void FillAngles(RigidPart* part);

}  // namespace editnerf
