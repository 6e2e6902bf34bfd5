// Where samples lie along rays: stratified, and drawn from the weights of an earlier pass.
//
// Distances t are along the unit direction from the camera centre, in scene units, ascending along each ray. Sample i
// stands for the interval from t_i to t_{i+1}, the last one for the interval to `far`. Random numbers come from
// LibTorch's default generator of the tensors' device; with `jitter` false nothing is random. No gradients pass.
#pragma once

#include <torch/types.h>

#include <cstdint>

namespace editnerf {

// near and far [R] -> [R, count]: one sample in each of `count` equal parts, at a random place or in the middle.
torch::Tensor StratifiedSamples(const torch::Tensor& near, const torch::Tensor& far, int64_t count, bool jitter);

// Draws from a piecewise constant density by inverting its distribution function: edges [R, B + 1] ascending,
// weights [R, B] >= 0 -> [R, count] ascending, within the edges. 1e-5 is added to every weight, so that rays without
// weight are sampled evenly over the bins; without `jitter` the quantiles (k + 0.5) / count are drawn.
torch::Tensor SampleFromBins(const torch::Tensor& edges, const torch::Tensor& weights, int64_t count, bool jitter);

// NeRF's second pass: t and weights [R, S], S >= 3, of the first pass -> [R, S + count] sorted, old and new samples.
// The bins are bounded by the middles between samples and hold the inner samples' weights.
torch::Tensor HierarchicalSamples(const torch::Tensor& t, const torch::Tensor& weights, int64_t count, bool jitter);

// Interval lengths [R, S] of samples t [R, S] with the last interval ending at far [R]; never negative.
torch::Tensor IntervalLengths(const torch::Tensor& t, const torch::Tensor& far);

}  // namespace editnerf
