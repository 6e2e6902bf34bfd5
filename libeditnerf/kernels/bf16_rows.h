// Rows of a tile (tile.h) as the operands of products in bfloat16 (bf16_product.h), and results as rows again.
#pragma once

#include <cstdint>

namespace editnerf {

// Rows of samples on their way from one product to the next. What is nullptr is left out.
struct Bf16Rows {
  const float* from = nullptr;  // [rows] of `stride` floats
  int64_t stride = 0;
  int64_t rows = 0, count = 0;  // count: samples, at most kTile
  const float* bias = nullptr;  // [rows], added
  bool relu = false;
  const float* mask = nullptr;  // [rows] of a tile: values stay where it is positive
  float* to = nullptr;          // [rows] of a tile
  uint32_t* pairs = nullptr;    // [padded rows / 2, kTile], as the b of a product over the rows; 0 behind the last
  uint32_t* rest = nullptr;     // the same of what rounding took away
  uint16_t* plain = nullptr;    // [padded rows, kTile], as the a of a product over samples; 0 behind the last of both
  float* sums = nullptr;        // [rows, 16], added: over the samples, sixteen sums of a row that are to be added up
};

void MoveBf16Rows(const Bf16Rows& rows);

// out [kTile / 2, stride]: row k holds samples 2 k and 2 k + 1 of every row of a tile, as the b of a product over the
// samples; 0 behind the last, up to padded samples and rows.
void TransposeBf16Rows(const float* rows, int64_t num_rows, int64_t count, uint32_t* out, int64_t stride);

}  // namespace editnerf
