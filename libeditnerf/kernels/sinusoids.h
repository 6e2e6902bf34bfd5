// Sines and cosines of doubling frequencies for many samples at once; SIMD chosen at run time (Highway).
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

namespace editnerf {

constexpr int64_t kMostFusedOctaves = 12;  // larger phases would leave the range of the vectorised sine

// Whether EncodeSinusoids takes x: float32 on the CPU, [S, D], and at most kMostFusedOctaves octaves.
bool CanEncodeSinusoids(const at::Tensor& x, const std::vector<float>& weights);

// x [S, D], within one period of zero -> [S, D * (2 K + identity)]: [x,] then weights[k] sin(2^k x), weights[k] cos(2^k
// x) for k = 0 .. K-1. Differentiable once. PositionalEncoding::forward is the same in plain LibTorch operations.
at::Tensor EncodeSinusoids(const at::Tensor& x, const std::vector<float>& weights, bool identity);

}  // namespace editnerf
