// An edit that shows what a run can do, made from the run alone.
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

// The way of a key point (D = 3), or of several that move as one (D = 3 n): from `rest` there and back along the
// positions that it visited, in `count` (>= 1) steps.
//
// The visited positions track [T, D], T >= 1, are ordered along their first principal component, smoothed by a moving
// window (a tenth of T) and run through at the pace of a cosine, starting at the place nearest to `rest` [D] and ahead
// of it by `phase` (1: a whole round). The first and last steps fade from and to `rest`. All positions are convex
// combinations of visited ones and `rest`; the same input gives the same way.
//
// Returns [count, D] float64 on the CPU. Throws ShapeError.
torch::Tensor SweepAlong(const torch::Tensor& track, const torch::Tensor& rest, int64_t count, double phase = 0);

// Camera and codes are those of the middle training frame, where all key points rest. Each key point in turn,
// or each group of key points whose ways resemble each other, sweeps along its way in `frames_per_sweep` (>= 2) frames;
// with several, all sweep at once in a last part, out of step. In a
// run without key points the camera goes along the training views and back instead. Throws DataError for a pretrained
// run, ConfigError for too few frames.
EditFile MakeDemoEdit(const Run& run, int64_t frames_per_sweep = 48);

}  // namespace editnerf
