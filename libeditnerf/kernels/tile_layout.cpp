#include "libeditnerf/kernels/tile_layout.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/tile_layout.cpp"  // compiled once for every target
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Tag>;

HWY_INLINE hn::Mask<Tag> IsKept(const float* keep, int64_t s) {
  return hn::Gt(hn::LoadU(Tag(), keep + s), hn::Zero(Tag()));
}

int64_t AppendKeptImpl(const float* keep, const float* from, int64_t count, int64_t num_rows, int64_t at, float* to,
                       float* next) {
  const Tag tag;
  const auto lanes = static_cast<int64_t>(hn::Lanes(tag));
  int64_t kept[kTile] = {}, total = 0;  // of each vector
  for (int64_t s = 0; s < count; s += lanes) {
    kept[s / lanes] = static_cast<int64_t>(hn::CountTrue(tag, IsKept(keep, s)));
    total += kept[s / lanes];
  }
  for (int64_t r = 0; r < num_rows; ++r) {
    const float* const in = TileRow(from, r);
    float *const out = TileRow(to, r), *const behind = TileRow(next, r);
    int64_t column = at;
    for (int64_t s = 0; s < count; s += lanes) {
      const int64_t some = kept[s / lanes];
      Vector values = hn::LoadU(tag, in + s);
      if (some < lanes) values = hn::Compress(values, IsKept(keep, s));
      hn::StoreU(values, tag, column < kTile ? out + column : behind + (column - kTile));
      if (column < kTile && column + some > kTile) {  // the tile's end has room for a vector
        hn::StoreU(hn::LoadU(tag, out + kTile), tag, behind);
      }
      column += some;
    }
  }
  return total;
}

// Sixteen rows at a time through registers, by the compiler's own vectors: Highway has no shuffle across 128-bit blocks
// that works for every target.
using Sixteen = float __attribute__((vector_size(64)));

HWY_INLINE void TransposeBlock(const float* rows, float* out, int64_t out_stride) {
  Sixteen a[16], b[16];
  for (int i = 0; i < 16; ++i) __builtin_memcpy(&a[i], TileRow(rows, i), sizeof(Sixteen));
  // Each stage interleaves row i with row i + 8; four of them rotate the four bits of the row number into the column.
  for (int stage = 0; stage < 4; ++stage) {
    for (int i = 0; i < 8; ++i) {
      b[2 * i] = __builtin_shufflevector(a[i], a[i + 8], 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
      b[2 * i + 1] =
          __builtin_shufflevector(a[i], a[i + 8], 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
    }
    for (int i = 0; i < 16; ++i) a[i] = b[i];
  }
  for (int i = 0; i < 16; ++i) __builtin_memcpy(out + i * out_stride, &a[i], sizeof(Sixteen));
}

void TransposeRowsImpl(const float* rows, int64_t num_rows, int64_t count, float* out, int64_t out_stride) {
  for (int64_t s = 0; s < count; s += 16) {
    for (int64_t r = 0; r < num_rows; r += 16) {
      TransposeBlock(TileRow(rows, r) + s, out + s * out_stride + r, out_stride);
    }
  }
}

void AddRowSumsImpl(const float* rows, int64_t num_rows, int64_t count, float* sums) {
  const Tag tag;
  const auto lanes = static_cast<int64_t>(hn::Lanes(tag));
  for (int64_t r = 0; r < num_rows; ++r) {
    const float* const row = TileRow(rows, r);
    Vector total = hn::Zero(tag);
    int64_t s = 0;
    for (; s + lanes <= count; s += lanes) total = hn::Add(total, hn::LoadU(tag, row + s));
    float sum = hn::GetLane(hn::SumOfLanes(tag, total));
    for (; s < count; ++s) sum += row[s];
    sums[r] += sum;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(AppendKeptImpl);
HWY_EXPORT(TransposeRowsImpl);
HWY_EXPORT(AddRowSumsImpl);

int64_t AppendKept(const float* keep, const float* from, int64_t count, int64_t num_rows, int64_t at, float* to,
                   float* next) {
  return HWY_DYNAMIC_DISPATCH(AppendKeptImpl)(keep, from, count, num_rows, at, to, next);
}

void TransposeRows(const float* rows, int64_t num_rows, int64_t count, float* out, int64_t out_stride) {
  HWY_DYNAMIC_DISPATCH(TransposeRowsImpl)(rows, num_rows, count, out, out_stride);
}

void AddRowSums(const float* rows, int64_t num_rows, int64_t count, float* sums) {
  HWY_DYNAMIC_DISPATCH(AddRowSumsImpl)(rows, num_rows, count, sums);
}

}  // namespace editnerf
#endif
