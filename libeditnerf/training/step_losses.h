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

// Those of some of the step's rays, as means over them, module by module. `samples`: how many were evaluated.
NamedTensors RayLosses(const Run& run, const RayBatch& rays, const torch::Tensor& target, const FrameStates& states,
                       const RayOptions& options, int64_t* samples);

// L_motion and L_geo over all pairs of neighbouring frames, for key_points [F or more, N, 3], scene units, of the F
// cameras first. None for fewer than two frames.
NamedTensors KeyPointLosses(const StageConfig& stage, const CameraTensors& cameras,
                            const KeyPointSupervision& supervision, const torch::Tensor& key_points);

}  // namespace editnerf
