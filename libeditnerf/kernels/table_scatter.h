// Gradients of hash tables from many tiles, without atomics and without a table for each thread: tiles leave the
// gradients of their features here, and afterwards the levels are shared out among the threads, each of which goes
// through all tiles in order. So the sums do not depend on the number of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "libeditnerf/kernels/fused_field.h"
#include "libeditnerf/kernels/tile.h"

namespace editnerf {

// The feature gradients of some tiles; memory is reused after Clear.
class FeatureGradients {
 public:
  struct Tile {
    int64_t count;
    float* unit;       // [3], coordinates of the canonical hash
    float* local;      // [3], of the local one
    float* canonical;  // [canonical_features]
    float* locals;     // [local_features]
    float* shade;      // [3 N], coordinates of the shade encoding
    float* shades;     // [N shade_features]
  };

  FeatureGradients(const FieldRows& rows, int64_t num_key_points)
      : rows_(rows), shades_(rows.shade_features > 0 ? num_key_points : 0) {}

  void Clear() { used_ = 0; }
  Tile Next(int64_t count);  // room for another tile

  int64_t size() const { return used_; }
  Tile operator[](int64_t index) const;

 private:
  struct Block {
    TileMemory memory;
    int64_t count = 0;
    explicit Block(int64_t rows) : memory(rows) {}
  };
  FieldRows rows_;
  int64_t shades_;  // N, where there is shade
  std::vector<std::unique_ptr<Block>> blocks_;
  int64_t used_ = 0;
};

// Adds the gradients of all tables to their `.grad`, over all tiles of all lists in order.
void ScatterToTables(const FusedField& field, const std::vector<const FeatureGradients*>& lists);

}  // namespace editnerf
