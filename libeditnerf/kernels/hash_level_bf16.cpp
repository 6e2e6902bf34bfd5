#include "libeditnerf/kernels/hash_level.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/hash_level_bf16.cpp"  // compiled once for every target
// clang-format off
#include <hwy/foreach_target.h>  // before all other headers of Highway
#include <hwy/highway.h>

#include "libeditnerf/kernels/hash_cells-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

// Ties to even; a NaN stays one, and what is too large becomes infinite.
HWY_INLINE hn::Vec<WordTag> Rounded(hn::Vec<FloatTag> x) {
  const WordTag w;
  const auto bits = hn::BitCast(w, x);
  const auto odd = hn::And(hn::ShiftRight<16>(bits), hn::Set(w, 1));
  const auto rounded = hn::Add(bits, hn::Add(odd, hn::Set(w, 0x7fff)));
  return hn::IfThenElse(hn::RebindMask(w, hn::IsNaN(x)), hn::Or(bits, hn::Set(w, 0x400000)), rounded);
}

void Pack(const float* features, int64_t table_size, uint32_t* entries) {
  const FloatTag f;
  const WordTag w;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  const auto upper_half = hn::Set(w, 0xffff0000);
  const auto pack = [&](const float* from, uint32_t* to) {
    hn::Vec<FloatTag> first, second;
    hn::LoadInterleaved2(f, from, first, second);
    hn::StoreU(hn::Or(hn::ShiftRight<16>(Rounded(first)), hn::And(Rounded(second), upper_half)), w, to);
  };
  int64_t i = 0;
  for (; i + lanes <= table_size; i += lanes) pack(features + 2 * i, entries + i);
  if (i < table_size) {
    float rest[2 * 16] = {};
    uint32_t packed[16];
    for (int64_t k = 2 * i; k < 2 * table_size; ++k) rest[k - 2 * i] = features[k];
    pack(rest, packed);
    for (int64_t k = i; k < table_size; ++k) entries[k] = packed[k - i];
  }
  entries[table_size] = entries[0];
}

// Both ends of the four edges of every sample's cell, copied one by one: hardware gathers are hardly faster on some
// processors, and slower on others. A loop of its own, as a vector that is loaded right behind the stores of its parts
// would wait for them.
struct Ends {
  alignas(64) uint32_t words[4][2 * kHashTile];
};

HWY_INLINE void CopyEnds(const Cells& cells, int64_t count, const uint32_t* entries, Ends& ends) {
  for (int jk = 0; jk < 4; ++jk) {
    for (int64_t s = 0; s < count; ++s) {
      __builtin_memcpy(ends.words[jk] + 2 * s, entries + cells.entry[jk][s], 2 * sizeof(uint32_t));
    }
  }
}

// Returns the samples with those that fill up the last vector.
HWY_INLINE int64_t LookUp(const HashPoints& points, const HashLevel& where, const uint32_t* entries, Cells& cells,
                          Ends& ends) {
  const HashPoints whole = WholeVectors(points);
  FindCells(whole, hash_index::Level(where.resolution, where.table_size), where.resolution, cells);
  CopyEnds(cells, whole.count, entries, ends);
  return whole.count;
}

// Features of the lower and the upper end of an edge.
struct Edge {
  hn::Vec<FloatTag> low0, low1, high0, high1;
};

HWY_INLINE Edge LoadEdge(const Ends& ends, int jk, int64_t s) {
  const FloatTag f;
  const WordTag w;
  const auto upper_half = hn::Set(w, 0xffff0000);
  hn::Vec<WordTag> low, high;
  hn::LoadInterleaved2(w, ends.words[jk] + 2 * s, low, high);
  return {hn::BitCast(f, hn::ShiftLeft<16>(low)), hn::BitCast(f, hn::And(low, upper_half)),
          hn::BitCast(f, hn::ShiftLeft<16>(high)), hn::BitCast(f, hn::And(high, upper_half))};
}

void Encode(const HashPoints& points, const HashLevel& where, const uint32_t* entries, float* out0, float* out1) {
  const FloatTag f;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  Cells cells;
  Ends ends;
  const int64_t count = LookUp(points, where, entries, cells, ends);
  for (int64_t s = 0; s < count; s += lanes) {
    auto low0 = hn::Zero(f), low1 = low0, high0 = low0, high1 = low0;
    for (int jk = 0; jk < 4; ++jk) {
      const Edge edge = LoadEdge(ends, jk, s);
      const auto weight = hn::Load(f, cells.weight[jk] + s);
      low0 = hn::MulAdd(weight, edge.low0, low0);
      low1 = hn::MulAdd(weight, edge.low1, low1);
      high0 = hn::MulAdd(weight, edge.high0, high0);
      high1 = hn::MulAdd(weight, edge.high1, high1);
    }
    const auto upper = hn::Load(f, cells.fraction[0] + s);
    hn::StoreU(hn::MulAdd(upper, hn::Sub(high0, low0), low0), f, out0 + s);
    hn::StoreU(hn::MulAdd(upper, hn::Sub(high1, low1), low1), f, out1 + s);
  }
}

// With the features of every corner weighted by their gradients there is one number a corner to differentiate.
void Slope(const HashPoints& points, const HashLevel& where, const uint32_t* entries, const float* grad0,
           const float* grad1, float* const slope[3]) {
  const FloatTag f;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  const auto scale = hn::Set(f, static_cast<float>(where.resolution));
  Cells cells;
  Ends ends;
  const int64_t count = LookUp(points, where, entries, cells, ends);
  for (int64_t s = 0; s < count; s += lanes) {
    const auto g0 = hn::Mul(scale, hn::LoadU(f, grad0 + s)), g1 = hn::Mul(scale, hn::LoadU(f, grad1 + s));
    const auto x = hn::Load(f, cells.fraction[0] + s), y = hn::Load(f, cells.fraction[1] + s),
               z = hn::Load(f, cells.fraction[2] + s);
    auto along = hn::Zero(f);
    hn::Vec<FloatTag> on_edge[4];
    for (int jk = 0; jk < 4; ++jk) {
      const Edge edge = LoadEdge(ends, jk, s);
      const auto low = hn::MulAdd(g0, edge.low0, hn::Mul(g1, edge.low1));
      const auto rise = hn::Sub(hn::MulAdd(g0, edge.high0, hn::Mul(g1, edge.high1)), low);
      along = hn::MulAdd(hn::Load(f, cells.weight[jk] + s), rise, along);
      on_edge[jk] = hn::MulAdd(x, rise, low);
    }
    const auto add = [&](int axis, hn::Vec<FloatTag> value) {
      hn::StoreU(hn::Add(hn::LoadU(f, slope[axis] + s), value), f, slope[axis] + s);
    };
    const auto between = [](hn::Vec<FloatTag> from, hn::Vec<FloatTag> to, hn::Vec<FloatTag> share) {
      return hn::MulAdd(share, hn::Sub(to, from), from);
    };
    add(0, along);
    add(1, between(hn::Sub(on_edge[1], on_edge[0]), hn::Sub(on_edge[3], on_edge[2]), z));
    add(2, between(hn::Sub(on_edge[2], on_edge[0]), hn::Sub(on_edge[3], on_edge[1]), y));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(Pack);
HWY_EXPORT(Encode);
HWY_EXPORT(Slope);

void PackHashEntries(const float* features, int64_t table_size, uint32_t* entries) {
  HWY_DYNAMIC_DISPATCH(Pack)(features, table_size, entries);
}

void EncodeBf16HashLevel(const HashPoints& points, const HashLevel& level, const uint32_t* entries, float* out0,
                         float* out1) {
  HWY_DYNAMIC_DISPATCH(Encode)(points, level, entries, out0, out1);
}

void SlopeBf16HashLevel(const HashPoints& points, const HashLevel& level, const uint32_t* entries, const float* grad0,
                        const float* grad1, float* const slope[3]) {
  HWY_DYNAMIC_DISPATCH(Slope)(points, level, entries, grad0, grad1, slope);
}

}  // namespace editnerf
#endif
