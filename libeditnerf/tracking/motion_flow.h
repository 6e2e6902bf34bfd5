// Flow of a sequence once more, from where motion goes on as it did.
#pragma once

#include <torch/types.h>

#include <vector>

#include "libeditnerf/tracking/flow_sequence.h"

namespace editnerf {

// Per pixel the guess under which the 7 x 7 pixels around it look most alike in both images; the first of equal ones.
// from, to [H, W, 3] uint8; guesses, at least one, [H, W, 2] float32 -> [H, W, 2] float32.
torch::Tensor MostAlike(const torch::Tensor& from, const torch::Tensor& to, const std::vector<torch::Tensor>& guesses);

// `sequence`, found for images [T, H, W, 3] uint8 by the same flow or another, found again: each pair begins, per
// pixel, from what was found for it, from the way the pixel came (its backward flow, turned around) or from the way the
// next pair goes there, whichever looks most alike. A part that is fast for its size, which a search from stillness
// loses, is found from the frame in which it was slower. Throws Interrupted.
FlowSequence CarryMotionOn(const torch::Tensor& images, const OpticalFlow& flow, const FlowSequence& sequence);

}  // namespace editnerf
