// Parts that are held by what stands still in the scene, whatever it is: a hinge (part_hinge.h), a line or a plane
// (part_slide.h).
#pragma once

#include <optional>
#include <vector>

#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

// As SolveHinge (part_hinge.h), in the part's kind of motion, from what holds it nearest to its poses in the frames
// that see it.
std::optional<double> SolveHeld(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, RigidPart* part);

// The part in another kind of motion, at the distance at which that costs least; empty where nothing comes out.
std::optional<RigidPart> HeldBy(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, const RigidPart& part, PartMotion motion);

// Poses of frames that do not see the part: those of the nearest that does, or, where it is held, from both sides.
void FillUnseen(RigidPart* part);

}  // namespace editnerf
