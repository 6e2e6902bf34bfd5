// Chosen samples of many tiles, side by side in tiles of their own: what is computed for them alone takes full tiles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "libeditnerf/kernels/fused_field.h"
#include "libeditnerf/kernels/tile.h"
#include "libeditnerf/kernels/tile_layout.h"

namespace editnerf {

class PackedTiles {
 public:
  // Of tiles with `rows` rows; `ranges` of them are taken along.
  PackedTiles(int64_t rows, std::vector<RowRange> ranges)
      : ranges_(std::move(ranges)),
        tile_(std::make_unique<TileMemory>(rows)),
        next_(std::make_unique<TileMemory>(rows)) {}

  void Clear() { count_ = 0; }

  // Appends the columns of `from` where the row keep is positive; it must be 0 behind the last, up to kTileStride. The
  // tile must not be full.
  void Append(const float* keep, const TileMemory& from, int64_t count) {
    int64_t kept = 0;
    for (const RowRange& range : ranges_) {
      kept = AppendKept(keep, from.Row(range.first), count, range.count, count_, tile_->Row(range.first),
                        next_->Row(range.first));
    }
    count_ += kept;
  }

  bool full() const { return count_ >= kTile; }
  int64_t count() const { return std::min(count_, kTile); }  // of samples in the tile
  TileMemory& tile() { return *tile_; }

  // Goes on to what did not fit into the tile.
  void Next() {
    std::swap(tile_, next_);
    count_ -= count();
  }

 private:
  std::vector<RowRange> ranges_;
  std::unique_ptr<TileMemory> tile_, next_;
  int64_t count_ = 0;
};

}  // namespace editnerf
