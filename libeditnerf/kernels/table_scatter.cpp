#include "libeditnerf/kernels/table_scatter.h"

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/kernels/gradient.h"
#include "libeditnerf/kernels/hash_level.h"

namespace editnerf {
namespace {

// The two rows that a level reads of the next tile: they come from the third-level cache, and no other row of the tile
// is read until the level is done.
void Prefetch(const float* grad, int64_t count) {
  constexpr int64_t kLine = 16;  // floats
  for (int64_t row = 0; row < 2; ++row) {
    for (int64_t s = 0; s < count; s += kLine) __builtin_prefetch(TileRow(grad, row) + s);
  }
}

// One level of a table, and where the tiles keep its coordinates and gradients.
struct ScatteredLevel {
  const FusedHash* hash;
  float* gradient;  // of the table's level
  int64_t level;
  float* FeatureGradients::Tile::*unit;
  float* FeatureGradients::Tile::*features;
  int64_t unit_row, feature_row;  // of them
};

void AddLevels(const FusedHash& hash, int64_t levels, float* FeatureGradients::Tile::*unit,
               float* FeatureGradients::Tile::*features, int64_t look_up, std::vector<ScatteredLevel>* all) {
  float* const gradient = levels > 0 ? GradientOf(hash.table) : nullptr;
  for (int64_t level = 0; level < levels; ++level) {
    all->push_back({&hash, gradient + 2 * level * hash.table.size(1), level, unit, features, 3 * look_up,
                    2 * (look_up * levels + level)});
  }
}

}  // namespace

FeatureGradients::Tile FeatureGradients::Next(int64_t count) {
  if (used_ == static_cast<int64_t>(blocks_.size())) {
    blocks_.push_back(std::make_unique<Block>(6 + rows_.canonical_features + rows_.local_features +
                                              shades_ * (3 + rows_.shade_features)));
  }
  blocks_[static_cast<size_t>(used_)]->count = count;
  return (*this)[used_++];
}

FeatureGradients::Tile FeatureGradients::operator[](int64_t index) const {
  Block& block = *blocks_[static_cast<size_t>(index)];
  const int64_t locals = 6 + rows_.canonical_features, shade = locals + rows_.local_features;
  return {block.count,
          block.memory.Row(0),
          block.memory.Row(3),
          block.memory.Row(6),
          block.memory.Row(locals),
          block.memory.Row(shade),
          block.memory.Row(shade + 3 * shades_)};
}

void ScatterToTables(const FusedField& field, const std::vector<const FeatureGradients*>& lists) {
  const TeamPhase phase(Phase::kTableGradients);
  using Tile = FeatureGradients::Tile;
  std::vector<ScatteredLevel> levels;
  AddLevels(field.canonical, static_cast<int64_t>(field.canonical.resolutions.size()), &Tile::unit, &Tile::canonical, 0,
            &levels);
  AddLevels(field.local, OpenLocalLevels(field), &Tile::local, &Tile::locals, 0, &levels);
  const auto own = static_cast<int64_t>(levels.size()), shaded = static_cast<int64_t>(field.shade.resolutions.size());
  for (int64_t i = 0; shaded > 0 && i < field.num_key_points; ++i) {
    AddLevels(field.shade, shaded, &Tile::shade, &Tile::shades, i, &levels);
  }
  const auto scatter = [&](const ScatteredLevel& at) {
    for (const FeatureGradients* list : lists) {
      for (int64_t i = 0; i < list->size(); ++i) {
        const Tile tile = (*list)[i];
        const float* const unit = TileRow(tile.*at.unit, at.unit_row);
        const float* const grad = TileRow(tile.*at.features, at.feature_row);
        if (i + 1 < list->size()) Prefetch(TileRow((*list)[i + 1].*at.features, at.feature_row), (*list)[i + 1].count);
        ScatterHashLevel({tile.count, {TileRow(unit, 0), TileRow(unit, 1), TileRow(unit, 2)}},
                         {at.hash->resolutions[static_cast<size_t>(at.level)], at.hash->table.size(1)}, grad,
                         TileRow(grad, 1), at.gradient);
      }
    }
  };
  // A level of the shade table belongs to one thread, for all key points.
  ParallelFor(own + shaded, 1, [&](int64_t first, int64_t last) {
    for (int64_t l = first; l < last; ++l) {
      const int64_t look_ups = l < own ? 1 : field.num_key_points;
      for (int64_t i = 0; i < look_ups; ++i) scatter(levels[static_cast<size_t>(l + i * shaded)]);
    }
  });
}

}  // namespace editnerf
