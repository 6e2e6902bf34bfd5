// Where a part rests. What its tracks make of a rest is drift, slow and without end.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

constexpr double kStillPixels = 0.02;  // standard deviation of a part at rest, at 320 wide, a frame

// Whether the part's way around the step from the i-th of the frames, which are in time order, to the next is that of
// one at rest (PartSolverOptions::rest_pixels). A way to or from the camera, of which images tell little, counts for
// less.
bool RestsAt(const Clip& clip, const RigidPart& part, const PartSolverOptions& options,
             const std::vector<int64_t>& frames, size_t i);

}  // namespace editnerf
