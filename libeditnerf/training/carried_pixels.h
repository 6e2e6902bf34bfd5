// Where moving parts are seen in the validation frames.
#pragma once

#include <torch/types.h>

#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

// Pixels [R] int64, ascending, counted through the validation frames row by row: those within an eightieth of the
// image's width from a place that a key point carries. Places come from the training frame that shows the validation
// frame's state, or the one before it, moved along with their key point. tracks [T, N, 3], scene units. Empty where
// nothing is carried, or no frame is held out.
torch::Tensor CarriedPixels(const Scene& scene, const DepthTargets& places, const torch::Tensor& tracks);

}  // namespace editnerf
