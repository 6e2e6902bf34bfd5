// How rows of a tile (tile.h) are moved and summed. SIMD chosen at run time (Highway).
#pragma once

#include <cstdint>

#include "libeditnerf/kernels/tile.h"

namespace editnerf {

// Appends to each of `num_rows` rows of `to`, from column `at` < kTile on, the columns of `from` where keep [1 row] is
// positive, among its first `count`, and returns how many; keep is 0 behind those. What lies beyond kTile goes to the
// first columns of `next` instead, and up to 15 columns behind the last are overwritten.
int64_t AppendKept(const float* keep, const float* from, int64_t count, int64_t num_rows, int64_t at, float* to,
                   float* next);

// The transpose of rows [num_rows, count] into out[s * out_stride + row]; num_rows and count are rounded up to 16.
void TransposeRows(const float* rows, int64_t num_rows, int64_t count, float* out, int64_t out_stride);

// sums[row] += sum over the samples, exactly `count` of them.
void AddRowSums(const float* rows, int64_t num_rows, int64_t count, float* sums);

}  // namespace editnerf
