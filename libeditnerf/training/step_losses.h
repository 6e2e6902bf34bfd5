// The terms of a step's loss, by name and with their weights.
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/geometry/camera_tensors.h"
#include "libeditnerf/render/ray_batch.h"
#include "libeditnerf/training/key_point_supervision.h"
#include "libeditnerf/training/run.h"
#include "libeditnerf/training/step_guard.h"

namespace editnerf {

struct StepLosses {
  NamedTensors terms;
  torch::Tensor missed;  // [R], mean over the channels of (rgb - target)^2; no gradients
  int64_t samples = 0;   // field evaluations with colour
};

struct RayColors {
  torch::Tensor target;    // [R, 3], in [0, 1]
  torch::Tensor emphasis;  // [R], what each ray's colours count for; undefined: all for 1
};

// Those of some of the step's rays, as means over them, module by module.
StepLosses RayLosses(const Run& run, const RayBatch& rays, const RayColors& colors, const FrameStates& states,
                     const RayOptions& options);

// L_motion and L_geo over all pairs of neighbouring frames, for key_points [F or more, N, 3], scene units, of the F
// cameras first. None for fewer than two frames.
NamedTensors KeyPointLosses(const StageConfig& stage, const CameraTensors& cameras,
                            const KeyPointSupervision& supervision, const torch::Tensor& key_points);

}  // namespace editnerf
