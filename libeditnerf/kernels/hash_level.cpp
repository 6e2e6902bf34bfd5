#include "libeditnerf/kernels/hash_level.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/hash_level.cpp"  // compiled once for every target
// clang-format off
#include <hwy/foreach_target.h>  // before all other headers of Highway
#include <hwy/highway.h>

#include "libeditnerf/kernels/hash_cells-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

// Two neighbours along the first axis, two features each. Highway has no vectors of four where there is no SIMD at all,
// but compilers do.
using Pair = float __attribute__((vector_size(16)));

HWY_INLINE Pair Load(const float* from) {
  Pair pair;
  __builtin_memcpy(&pair, from, sizeof(pair));
  return pair;
}

HWY_INLINE void Store(Pair pair, float* to) { __builtin_memcpy(to, &pair, sizeof(pair)); }

HWY_INLINE Pair Repeat(float x) { return Pair{x, x, x, x}; }

// Both ends of an edge. The upper end follows in memory but for the last entry, whose neighbour is the first.
template <bool kWraps>
HWY_INLINE Pair LoadEdge(const float* features, uint32_t entry, uint32_t mask) {
  const float* const at = features + 2 * static_cast<size_t>(entry);
  if (!kWraps || HWY_LIKELY(entry != mask)) return Load(at);
  return Pair{at[0], at[1], features[0], features[1]};
}

template <bool kWraps>
HWY_INLINE void AddToEdge(Pair value, float* features, uint32_t entry, uint32_t mask) {
  float* const at = features + 2 * static_cast<size_t>(entry);
  if (!kWraps || HWY_LIKELY(entry != mask)) return Store(Load(at) + value, at);
  at[0] += value[0], at[1] += value[1];
  features[0] += value[2], features[1] += value[3];
}

// Both loops over all samples, not vector by vector: what the first stores in parts the second loads whole, and a load
// so soon after would wait for the stores.
template <bool kWraps>
HWY_INLINE void EncodeCells(const Cells& cells, int64_t count, const float* features, uint32_t mask, float* out0,
                            float* out1) {
  alignas(64) float ends[4 * kHashTile];
  const FloatTag f;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  for (int64_t s = 0; s < count; ++s) {
    Pair sum = {};
    for (int jk = 0; jk < 4; ++jk) {
      sum += LoadEdge<kWraps>(features, cells.entry[jk][s], mask) * Repeat(cells.weight[jk][s]);
    }
    Store(sum, ends + 4 * s);
  }
  for (int64_t s = 0; s < count; s += lanes) {
    hn::Vec<FloatTag> low0, low1, high0, high1;
    hn::LoadInterleaved4(f, ends + 4 * s, low0, low1, high0, high1);
    const auto upper = hn::Load(f, cells.fraction[0] + s);
    hn::StoreU(hn::MulAdd(upper, hn::Sub(high0, low0), low0), f, out0 + s);
    hn::StoreU(hn::MulAdd(upper, hn::Sub(high1, low1), low1), f, out1 + s);
  }
}

void Encode(const HashPoints& points, const HashLevel& where, const float* features, float* out0, float* out1) {
  const hash_index::Level level(where.resolution, where.table_size);
  Cells cells;
  const HashPoints whole = WholeVectors(points);
  FindCells(whole, level, where.resolution, cells);
  if (cells.wraps) return EncodeCells<true>(cells, whole.count, features, level.mask, out0, out1);
  EncodeCells<false>(cells, whole.count, features, level.mask, out0, out1);
}

template <bool kWraps>
HWY_INLINE void ScatterCells(const Cells& cells, int64_t count, const float* grad0, const float* grad1, uint32_t mask,
                             float* grad_features) {
  for (int64_t s = 0; s < count; ++s) {
    const float g0 = grad0[s], g1 = grad1[s];
    if (g0 == 0 && g1 == 0) continue;  // outside the local cube
    const float upper = cells.fraction[0][s], lower = 1 - upper;
    const Pair value = Pair{g0, g1, g0, g1} * Pair{lower, lower, upper, upper};
    for (int jk = 0; jk < 4; ++jk) {
      AddToEdge<kWraps>(value * Repeat(cells.weight[jk][s]), grad_features, cells.entry[jk][s], mask);
    }
  }
}

void Scatter(const HashPoints& points, const HashLevel& where, const float* grad0, const float* grad1,
             float* grad_features) {
  const hash_index::Level level(where.resolution, where.table_size);
  Cells cells;
  FindCells(points, level, where.resolution, cells);
  if (cells.wraps) return ScatterCells<true>(cells, points.count, grad0, grad1, level.mask, grad_features);
  ScatterCells<false>(cells, points.count, grad0, grad1, level.mask, grad_features);
}

// With e_jk the ends of edge jk, both features: the slope along the first axis is that of sum w_jk e_jk between the
// ends, those along the others are differences of edges, read at the sample's place between the ends.
template <bool kWraps>
HWY_INLINE void SlopeOfCells(const Cells& cells, int64_t count, const float* features, uint32_t mask, float resolution,
                             const float* grad0, const float* grad1, float* const slope[3]) {
  alignas(64) float across[3][4 * kHashTile];
  const FloatTag f;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  const auto scale = hn::Set(f, resolution);
  for (int64_t s = 0; s < count; ++s) {
    Pair ends[4];
    for (int jk = 0; jk < 4; ++jk) ends[jk] = LoadEdge<kWraps>(features, cells.entry[jk][s], mask);
    Pair sum = {};
    for (int jk = 0; jk < 4; ++jk) sum += ends[jk] * Repeat(cells.weight[jk][s]);
    const Pair y = Repeat(cells.fraction[1][s]), z = Repeat(cells.fraction[2][s]);
    const Pair low_j = ends[1] - ends[0], high_j = ends[3] - ends[2];
    const Pair low_k = ends[2] - ends[0], high_k = ends[3] - ends[1];
    Store(sum, across[0] + 4 * s);
    Store(low_j + z * (high_j - low_j), across[1] + 4 * s);
    Store(low_k + y * (high_k - low_k), across[2] + 4 * s);
  }
  for (int64_t s = 0; s < count; s += lanes) {
    const auto g0 = hn::Mul(scale, hn::LoadU(f, grad0 + s)), g1 = hn::Mul(scale, hn::LoadU(f, grad1 + s));
    const auto upper = hn::Load(f, cells.fraction[0] + s);
    for (int axis = 0; axis < 3; ++axis) {
      hn::Vec<FloatTag> low0, low1, high0, high1;
      hn::LoadInterleaved4(f, across[axis] + 4 * s, low0, low1, high0, high1);
      auto change0 = hn::Sub(high0, low0), change1 = hn::Sub(high1, low1);
      if (axis > 0) change0 = hn::MulAdd(upper, change0, low0), change1 = hn::MulAdd(upper, change1, low1);
      const auto before = hn::LoadU(f, slope[axis] + s);
      hn::StoreU(hn::MulAdd(g0, change0, hn::MulAdd(g1, change1, before)), f, slope[axis] + s);
    }
  }
}

void Slope(const HashPoints& points, const HashLevel& where, const float* features, const float* grad0,
           const float* grad1, float* const slope[3]) {
  const hash_index::Level level(where.resolution, where.table_size);
  Cells cells;
  const HashPoints whole = WholeVectors(points);
  FindCells(whole, level, where.resolution, cells);
  const auto resolution = static_cast<float>(where.resolution);
  if (cells.wraps) {
    return SlopeOfCells<true>(cells, whole.count, features, level.mask, resolution, grad0, grad1, slope);
  }
  SlopeOfCells<false>(cells, whole.count, features, level.mask, resolution, grad0, grad1, slope);
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(Encode);
HWY_EXPORT(Scatter);
HWY_EXPORT(Slope);

void EncodeHashLevel(const HashPoints& points, const HashLevel& level, const float* features, float* out0,
                     float* out1) {
  HWY_DYNAMIC_DISPATCH(Encode)(points, level, features, out0, out1);
}

void ScatterHashLevel(const HashPoints& points, const HashLevel& level, const float* grad0, const float* grad1,
                      float* grad_features) {
  HWY_DYNAMIC_DISPATCH(Scatter)(points, level, grad0, grad1, grad_features);
}

void SlopeHashLevel(const HashPoints& points, const HashLevel& level, const float* features, const float* grad0,
                    const float* grad1, float* const slope[3]) {
  HWY_DYNAMIC_DISPATCH(Slope)(points, level, features, grad0, grad1, slope);
}

}  // namespace editnerf
#endif
