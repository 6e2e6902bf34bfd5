// Where a frame lies among the training frames: which rows of the per-frame tables (codes, key points) show its state.
#pragma once

#include <cstdint>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// Rows `before` and `after` of scene.train, blended as (1 - weight) * before + weight * after.
struct TimelinePosition {
  int64_t before = 0, after = 0;
  double weight = 0;
  bool trained = false;  // the frame shows the state of training frame `before` exactly: novel-view reconstruction;
                         // otherwise it lies between two training frames in time: interpolation
};

// By warp_id: equal to a training frame's, or else between the nearest smaller and larger ones (beyond either end, the
// end itself). Throws DataError for a frame without a warp_id (an edit frame).
TimelinePosition LocateInTime(const Scene& scene, int64_t frame);

}  // namespace editnerf
