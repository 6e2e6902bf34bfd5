// Tensors as rows of a tile, and back.
#pragma once

#include <torch/types.h>

#include <algorithm>
#include <limits>

#include "libeditnerf/kernels/tile.h"

namespace editnerf {

// [num_rows, count] into the rows of a tile, with NaN behind.
inline TileMemory TileOf(const torch::Tensor& values) {
  TileMemory tile(values.size(0));
  for (int64_t r = 0; r < values.size(0); ++r) {
    std::fill_n(tile.Row(r), kTileStride, std::numeric_limits<float>::quiet_NaN());
    for (int64_t s = 0; s < values.size(1); ++s) tile.Row(r)[s] = values[r][s].item<float>();
  }
  return tile;
}

inline torch::Tensor RowsOf(const float* rows, int64_t num_rows, int64_t count) {
  return torch::from_blob(const_cast<float*>(rows), {num_rows, count}, {kTileStride, 1}, torch::kFloat32).clone();
}

}  // namespace editnerf
