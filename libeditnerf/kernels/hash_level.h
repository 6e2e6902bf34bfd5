// One level of the hash encoding over a tile of samples, for float32 and two features per entry: the case that runs.
// SIMD chosen at run time (Highway). hash_encoding.cpp has the same for other types, and the formula.
#pragma once

#include <cstdint>

namespace editnerf {

constexpr int64_t kHashTile = 128;  // samples at most

// Coordinates of a tile, already clamped to [0, 1] and free of NaN.
struct HashTile {
  int64_t count = 0;
  alignas(64) float x[3][kHashTile];
};

struct HashLevel {
  int64_t resolution = 1;  // cells per axis, at most 2^22: a float32 cannot name more
  int64_t table_size = 1;  // entries, a power of two
};

// features [table_size, 2] -> out[s * stride], out[s * stride + 1] of every sample.
void EncodeHashLevel(const HashTile& tile, const HashLevel& level, const float* features, float* out, int64_t stride);

// Adds the gradient of the entries, given grad[s * stride] and grad[s * stride + 1].
void ScatterHashLevel(const HashTile& tile, const HashLevel& level, const float* grad, int64_t stride,
                      float* grad_features);

// Adds the gradient of the coordinates: slope[axis][s], also where they were clamped.
void SlopeHashLevel(const HashTile& tile, const HashLevel& level, const float* features, const float* grad,
                    int64_t stride, float slope[3][kHashTile]);

}  // namespace editnerf
