// One rigid part among the flow tracks, grown from a pixel: over the frames as structure from motion adds cameras, and
// over the tracks around that follow the same motion. Where all its tracks have ended it is looked for again by direct
// flow. At last its distance from the cameras is settled (part_scale.h), and a simpler motion is taken where it
// explains the tracks about as well: one without turns, or one on a hinge (part_hinge.h).
#pragma once

#include <optional>
#include <vector>

#include "libeditnerf/tracking/part_fit.h"

namespace editnerf {

struct GrowthOptions {
  PartSolverOptions solver;
  DepthRange range;             // of the static points that a track must not follow as well; NaN: it is not asked
  int64_t look_again_from = 0;  // pixels that follow the part, from which it is looked for again: that takes its time
};

// Empty where too few tracks around the seed move as one. `taken`: one flag a track, those that belong to other parts.
// Tracks on which the part was found again are appended to `tracks`, and flags to `taken`.
std::optional<RigidPart> GrowPart(const Clip& clip, DirectFlows* direct, const PartSeed& seed,
                                  std::vector<FlowTrack>* tracks, std::vector<bool>* taken,
                                  const GrowthOptions& options = {});

}  // namespace editnerf
