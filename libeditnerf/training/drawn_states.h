// States that no frame has, for rays through places that look the same in them, or would but for the light.
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

// Places that stand still and must not end up inside a part.
struct ClearPlaces {
  torch::Tensor place;    // [S, 3], scene units
  torch::Tensor frame;    // [S] int64, in which they were seen
  torch::Tensor carrier;  // [S] int64, as above
  torch::Tensor reach;    // [N], how far parts go from their key points, as of PartReach; undefined: known of none
};

// The same, but a key point within reach of a place that nothing carries is drawn again, three times at most, and left
// where it was in the place's frame then.
torch::Tensor DrawKeyPointsClearOf(const ClearPlaces& places, const torch::Tensor& key_points, bool along_the_way);

// How far parts reach from their key points: a little more than 98 % of the places [M, 3] that key_point [M] carries in
// frame [M] are away from key_points [F, N, 3]. [N], scene units, 0 where it carries none; undefined where none carries
// any.
torch::Tensor PartReach(const torch::Tensor& places, const torch::Tensor& frame, const torch::Tensor& key_point,
                        const torch::Tensor& key_points);

// Behind the states of the frames, rows with the `drawn` key points [S, N, 3] and the codes of the frames frame [S].
// Where carrier [S] is below 0, light stays what it is in that frame: parts cast their shade from where they are there
// (FrameStates::casters). So what a place looks like cannot hang on where parts are other than by their shade. carrier
// undefined: the field has no shade.
FrameStates WithDrawn(FrameStates states, const torch::Tensor& drawn, const torch::Tensor& frame,
                      const torch::Tensor& carrier);

}  // namespace editnerf
