// What changes in the course of training, as functions of how far it has come. (The coarse-to-fine windows of the
// encodings are the field's own.)
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/config/config.h"

namespace editnerf {

// How much of a stage is done, in [0, 1]: by steps or, where the stage has a limit of seconds, by whichever is nearer
// its end. `seconds` of training alone.
double StageProgress(const StageConfig& config, int64_t step, double seconds);

// initial * (final / initial)^progress; progress is clamped to [0, 1]. Both values > 0.
double ExponentialSchedule(double initial, double final, double progress);

// 0 until `delay`, then linear, 1 from delay + steps on; a step function at `delay` for steps = 0.
double LinearRamp(int64_t step, int64_t delay, int64_t steps);

// Steps along a ray: few while everything is fog, where fine samples show nothing and more rays do; all of them once
// surfaces have formed.
int64_t MarchStepsAt(int64_t step, int64_t configured);

// What stands behind the rays, [R, 3], fading from the mean colour [3] to random ones.
torch::Tensor BackgroundOf(const torch::Tensor& mean_color, int64_t rays, int64_t step);

}  // namespace editnerf
