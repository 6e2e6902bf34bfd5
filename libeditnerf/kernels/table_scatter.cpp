#include "libeditnerf/kernels/table_scatter.h"

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/kernels/gradient.h"
#include "libeditnerf/kernels/hash_level.h"

namespace editnerf {
namespace {

// The two rows that a level reads of the next tile: they come from the third-level cache, and no other row of the tile
// is read until the level is done.
void Prefetch(const FeatureGradients::Tile& tile, bool is_local, int64_t level) {
  constexpr int64_t kLine = 16;  // floats
  for (int64_t row = 2 * level; row < 2 * level + 2; ++row) {
    const float* const grad = TileRow(is_local ? tile.locals : tile.canonical, row);
    for (int64_t s = 0; s < tile.count; s += kLine) __builtin_prefetch(grad + s);
  }
}

}  // namespace

FeatureGradients::Tile FeatureGradients::Next(int64_t count) {
  if (used_ == static_cast<int64_t>(blocks_.size())) {
    blocks_.push_back(std::make_unique<Block>(6 + rows_.canonical_features + rows_.local_features));
  }
  blocks_[static_cast<size_t>(used_)]->count = count;
  return (*this)[used_++];
}

FeatureGradients::Tile FeatureGradients::operator[](int64_t index) const {
  Block& block = *blocks_[static_cast<size_t>(index)];
  return {block.count, block.memory.Row(0), block.memory.Row(3), block.memory.Row(6),
          block.memory.Row(6 + rows_.canonical_features)};
}

void ScatterToTables(const FusedField& field, const std::vector<const FeatureGradients*>& lists) {
  const TeamPhase phase(Phase::kTableGradients);
  const auto canonical_levels = static_cast<int64_t>(field.canonical.resolutions.size());
  const int64_t local_levels = OpenLocalLevels(field);
  float* const canonical = GradientOf(field.canonical.table);
  float* const local = field.local.table.defined() ? GradientOf(field.local.table) : nullptr;
  ParallelFor(canonical_levels + local_levels, 1, [&](int64_t first_level, int64_t last_level) {
    for (int64_t l = first_level; l < last_level; ++l) {
      const bool is_local = l >= canonical_levels;
      const FusedHash& hash = is_local ? field.local : field.canonical;
      const int64_t level = is_local ? l - canonical_levels : l, table_size = hash.table.size(1);
      float* const table = (is_local ? local : canonical) + 2 * level * table_size;
      for (const FeatureGradients* list : lists) {
        for (int64_t i = 0; i < list->size(); ++i) {
          const FeatureGradients::Tile tile = (*list)[i];
          const float* const unit = is_local ? tile.local : tile.unit;
          const float* const grad = TileRow(is_local ? tile.locals : tile.canonical, 2 * level);
          if (i + 1 < list->size()) Prefetch((*list)[i + 1], is_local, level);
          ScatterHashLevel({tile.count, {TileRow(unit, 0), TileRow(unit, 1), TileRow(unit, 2)}},
                           {hash.resolutions[static_cast<size_t>(level)], table_size}, grad, TileRow(grad, 1), table);
        }
      }
    }
  });
}

}  // namespace editnerf
