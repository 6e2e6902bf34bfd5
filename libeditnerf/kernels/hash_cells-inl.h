// Where samples lie in the cells of a level of the hash encoding, for the kernels of its levels. Included once for
// every target of Highway, inside the files that are compiled so.
#if defined(LIBEDITNERF_KERNELS_HASH_CELLS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LIBEDITNERF_KERNELS_HASH_CELLS_INL_H_
#undef LIBEDITNERF_KERNELS_HASH_CELLS_INL_H_
#else
#define LIBEDITNERF_KERNELS_HASH_CELLS_INL_H_
#endif

#include <hwy/highway.h>

#include "libeditnerf/kernels/hash_index.h"
#include "libeditnerf/kernels/hash_level.h"

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::Rebind<int32_t, FloatTag>;
using WordTag = hn::Rebind<uint32_t, FloatTag>;

// Where the cells of the samples lie in a level. Of the four edges of a cell along the first axis, edge jk has the
// upper neighbour along the second axis where jk & 1, and along the third where jk & 2.
struct Cells {
  alignas(64) uint32_t entry[4][kHashTile];  // of an edge's lower end
  alignas(64) float fraction[3][kHashTile];
  alignas(64) float weight[4][kHashTile];  // of an edge
  bool wraps;                              // whether some edge's upper end is the table's first entry
};

HWY_INLINE void FindCells(const HashPoints& points, const hash_index::Level& level, int64_t resolution, Cells& cells) {
  const FloatTag f;
  const IntTag i;
  const WordTag w;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  const auto scale = hn::Set(f, static_cast<float>(resolution));
  const auto last = hn::Set(i, static_cast<int32_t>(resolution - 1));
  const auto mask = hn::Set(w, level.mask), one = hn::Set(w, 1);
  const auto unit = hn::Set(f, 1.0F);
  auto highest = hn::Zero(w);
  for (int64_t s = 0; s < points.count; s += lanes) {
    hn::Vec<WordTag> corner[3];
    hn::Vec<FloatTag> upper[3], lower[3];
    for (int axis = 0; axis < 3; ++axis) {
      const auto scaled = hn::Mul(hn::LoadU(f, points.x[axis] + s), scale);
      const auto cell = hn::Min(hn::ConvertTo(i, scaled), last);
      corner[axis] = hn::BitCast(w, cell);
      upper[axis] = hn::Sub(scaled, hn::ConvertTo(f, cell));
      lower[axis] = hn::Sub(unit, upper[axis]);
      hn::Store(upper[axis], f, cells.fraction[axis] + s);
    }
    for (int jk = 0; jk < 4; ++jk) {
      const bool j = (jk & 1) != 0, k = (jk & 2) != 0;
      const auto y = j ? hn::Add(corner[1], one) : corner[1], z = k ? hn::Add(corner[2], one) : corner[2];
      const auto row = level.dense ? hn::Mul(hn::Set(w, level.side), hn::Add(y, hn::Mul(hn::Set(w, level.side), z)))
                                   : hn::Xor(hn::Mul(y, hn::Set(w, hash_index::kPrimeY)),
                                             hn::Mul(z, hn::Set(w, hash_index::kPrimeZ)));
      const auto entry = hn::And(hn::Add(corner[0], row), mask);
      highest = hn::Max(highest, entry);
      hn::Store(entry, w, cells.entry[jk] + s);
      hn::Store(hn::Mul(j ? upper[1] : lower[1], k ? upper[2] : lower[2]), f, cells.weight[jk] + s);
    }
  }
  cells.wraps = hn::GetLane(hn::MaxOfLanes(w, highest)) == level.mask;
}

// The points with those that fill up the last vector.
HWY_INLINE HashPoints WholeVectors(const HashPoints& points) {
  return {(points.count + 15) / 16 * 16, {points.x[0], points.x[1], points.x[2]}};
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#endif
