// Where a grid corner's features lie in a level's table; shared by the encoding's variants so that they cannot differ.
#pragma once

#include <cstdint>

namespace editnerf::hash_index {

constexpr uint32_t kPrimeY = 2654435761u;
constexpr uint32_t kPrimeZ = 805459861u;

// True where the level's (resolution + 1)^3 corners fit into `table_size` entries.
inline bool IsDense(int64_t resolution, int64_t table_size) {
  const int64_t side = resolution + 1;
  return side <= 2097151 && side * side * side <= table_size;
}

// Entry of corner (i, j, k), 0 <= i, j, k <= resolution.
struct Level {
  uint32_t side, mask;
  bool dense;

  Level(int64_t resolution, int64_t table_size)
      : side(static_cast<uint32_t>(resolution + 1)),
        mask(static_cast<uint32_t>(table_size - 1)),
        dense(IsDense(resolution, table_size)) {}

  uint32_t Row(uint32_t j, uint32_t k) const { return dense ? side * (j + side * k) : (j * kPrimeY) ^ (k * kPrimeZ); }
  uint32_t Entry(uint32_t i, uint32_t row) const { return (i + row) & mask; }
};

}  // namespace editnerf::hash_index
