// Which pixels move against the static scene.
//
// A pixel is followed by flow over up to a tenth of the sequence. How far it misses every static point between the
// nearest and the farthest depth around it (still_points.h) is evidence of motion of its own: at a depth edge flow
// mixes the motions of both sides. How far the depth maps themselves may be off is measured first, over the whole clip,
// and the range is widened by it: on a real capture whose walls have no texture the maps would otherwise make the walls
// move. Where the image has no texture nothing is known. The noise (flow and camera errors) is measured per frame as
// the median over the image, most of which is taken to be static. Motion along the epipolar line within the range looks
// static: the monocular ambiguity.
#pragma once

#include <torch/types.h>

#include "libeditnerf/tracking/clip.h"

namespace editnerf {

struct MotionEvidence {
  torch::Tensor ratio;  // [T, rows, columns] float32, distance over the frame's threshold: >= 1 moves; NaN: unknown
  int64_t cell = 4;     // pixels per cell, both axes
  double depth_uncertainty = 0;  // share of the depth by which the maps are off where nothing moves

  // Median of the 3 x 3 cells around a position, so that an edge in the depth map does not count; 0 if all are unknown.
  double At(int64_t t, const Pixel& p) const;

  // [T, height, width] bool: the pixels at which that is 1 or more.
  torch::Tensor MovingPixels(int64_t height, int64_t width) const;
};

// Threshold of frame t: max(0.75 pixels at 320 wide, 4 times the frame's median distance).
MotionEvidence MeasureMotion(const Clip& clip);

}  // namespace editnerf
