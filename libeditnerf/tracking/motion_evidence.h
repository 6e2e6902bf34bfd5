// Which pixels move against the static scene.
//
// A pixel's surface point, taken from the depth map, projects into the frames around by the cameras alone; the flow
// says where the pixel really went. The distance of the two, over up to a tenth of the sequence, is evidence of motion
// of its own. At a depth edge flow mixes the motions of both sides; so the distance is that to the segment between the
// projections of the nearest and the farthest depth around the pixel, on which every mixture of static motions lies.
// The noise (depth errors, camera errors) is measured per frame as the median over the image, most of which is taken to
// be static. Motion along the epipolar line within the depths around looks static: the monocular ambiguity.
#pragma once

#include <torch/types.h>

#include "libeditnerf/tracking/clip.h"

namespace editnerf {

struct MotionEvidence {
  torch::Tensor ratio;  // [T, rows, columns] float32, distance over the frame's threshold: >= 1 moves; NaN: unknown
  int64_t cell = 4;     // pixels per cell, both axes

  // Median of the 3 x 3 cells around a position, so that an edge in the depth map does not count; 0 if all are unknown.
  double At(int64_t t, const Pixel& p) const;
};

// Threshold of frame t: max(0.75 pixels at 320 wide, 4 times the frame's median distance).
MotionEvidence MeasureMotion(const Clip& clip);

}  // namespace editnerf
