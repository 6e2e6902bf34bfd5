// Pictures by which a person judges a detection, as uint8 [H, W, 3] RGB tensors.
#pragma once

#include <torch/types.h>

#include "libeditnerf/scene/scene.h"
#include "libeditnerf/tracking/key_point_detection.h"

namespace editnerf {

// The smoothed variance, largest value along z, y and x side by side (x right and y down; x right and z up; y right and
// z up), brightness scaled to the maximum. All candidates as small dots, the key points as rings in their colours.
torch::Tensor VariancePicture(const Detection& detection);

// A contact sheet of `count` training frames, evenly spaced, with every key point (a disk where visible, a ring where
// interpolated) and its way through the frames before.
torch::Tensor TracksPicture(const Scene& scene, const Detection& detection, int64_t count = 12, int64_t columns = 4);

// The same frames with the evidence of motion: red cells move against the static scene, blue ones do not, of the others
// nothing is known.
torch::Tensor MotionPicture(const Scene& scene, const Detection& detection, int64_t count = 12, int64_t columns = 4);

}  // namespace editnerf
