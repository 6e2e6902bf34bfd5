// How light known places are in the frames of a clip: what tells light that changes from things that move.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

// Some of the clip's frames, at most 79, evenly spread.
std::vector<int64_t> FramesLookedAt(const Clip& clip);

// The logarithm of how much lighter each of P places is in each of L frames than in its own, and than the others are
// there: what is exposed otherwise as a whole is as light as before. [P * L], row by row. NaN where that is not known:
// where the patch of 5 x 5 pixels has another hue than shade explains, something nearer in the clip's depth before it,
// or no room.
std::vector<float> LightOfPlaces(const Clip& clip, const DepthTargets& places, const std::vector<int64_t>& frames);

}  // namespace editnerf
