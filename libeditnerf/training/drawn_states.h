// States that no frame has, for rays through places that look the same in them.
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/field/radiance_field.h"

namespace editnerf {

// Each of N key points somewhere between two places of key_points [F, N, 3], by itself: positions that an edit may ask
// for. Parts that turn go along arcs, beside which no edit goes: with `along_the_way` the two places are those of one
// frame and the next. In row i, key point carrier[i] (none below 0) is where some frame has it. carrier: [S] int64.
// [S, N, 3], without gradients, by LibTorch's default CPU generator.
torch::Tensor DrawKeyPoints(const torch::Tensor& key_points, const torch::Tensor& carrier, bool along_the_way);

// Behind the states of the frames, rows with the `drawn` key points [S, N, 3] and the codes of the frames frame [S].
FrameStates WithDrawn(FrameStates states, const torch::Tensor& drawn, const torch::Tensor& frame);

}  // namespace editnerf
