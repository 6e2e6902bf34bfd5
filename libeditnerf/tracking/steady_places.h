// Which known places look the same in every state of the scene: those that rays may go through under key points drawn
// anew (train.still_share).
//
// Standing still is not enough. A part that rests for a while is triangulated with everything else, and is gone under
// another key point; and over the floor beside it its shadow passes, which no edit would show any more unless the field
// keeps shade by itself (field.fast.shade).
#pragma once

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

// Marks the others among `still`, whose distances hold as before, and returns how many they are:
//   - kNotCarried: places beside one of `parts` in its frame, as far away;
//   - kOtherLight: places that some of the frames that see them see darker or lighter than the rest of the scene is
//     there (place_light.h).
int64_t MarkUnsteadyPlaces(const Clip& clip, const DepthTargets& parts, DepthTargets* still);

}  // namespace editnerf
