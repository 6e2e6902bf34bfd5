#include "libeditnerf/kernels/occupied_samples.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/occupied_samples.cpp"  // compiled once for every target
// clang-format off
#include <hwy/foreach_target.h>  // before all other headers of Highway
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::Rebind<int32_t, FloatTag>;
using WordTag = hn::Rebind<uint32_t, FloatTag>;
using Floats = hn::Vec<FloatTag>;

// Products and sums one by one, never fused: samples on a wall fall to the same side as with LibTorch's operations.
HWY_INLINE void MoveIntoView(const GridView& view, const Floats x[3], Floats local[3]) {
  const FloatTag f;
  Floats apart[3] = {x[0], x[1], x[2]};
  for (int axis = 0; view.anchor != nullptr && axis < 3; ++axis) {
    apart[axis] = hn::Sub(apart[axis], hn::Set(f, view.anchor[axis]));
  }
  for (int own = 0; own < 3; ++own) {
    local[own] = apart[own];
    if (view.turn == nullptr) continue;
    const float* const row = view.turn + 3 * own;
    local[own] = hn::Add(hn::Add(hn::Mul(hn::Set(f, row[0]), apart[0]), hn::Mul(hn::Set(f, row[1]), apart[1])),
                         hn::Mul(hn::Set(f, row[2]), apart[2]));
  }
}

HWY_INLINE hn::Mask<WordTag> Occupied(const MarchedGrid& grid, const Floats x[3]) {
  const FloatTag f;
  const IntTag i;
  const WordTag w;
  const auto resolution = static_cast<int32_t>(grid.resolution);
  const auto end = hn::Set(f, static_cast<float>(resolution)), zero = hn::Zero(f);
  auto index = hn::Zero(i);
  auto inside = hn::Eq(zero, zero);
  for (int axis = 0; axis < 3; ++axis) {
    const auto cell = hn::Mul(hn::Sub(x[axis], hn::Set(f, grid.low[axis])), hn::Set(f, grid.scale[axis]));
    inside = hn::And(inside, hn::And(hn::Ge(cell, zero), hn::Lt(cell, end)));
    index = hn::Add(hn::Mul(index, hn::Set(i, resolution)), hn::ConvertTo(i, cell));
  }
  const auto all_inside = hn::RebindMask(i, inside);
  index = hn::IfThenElseZero(all_inside, index);
  // Four cells at a time, and not beyond the last one.
  const int32_t cells = resolution * resolution * resolution;
  const auto from = hn::Min(index, hn::Set(i, cells > 4 ? cells - 4 : 0));
  const auto shift = hn::BitCast(w, hn::ShiftLeft<3>(hn::Sub(index, from)));
  const auto four = hn::GatherOffset(w, reinterpret_cast<const uint32_t*>(grid.occupied), from);
  const auto found = hn::TestBit(hn::Shr(four, shift), hn::Set(w, 1));
  return hn::And(found, hn::RebindMask(w, inside));
}

uint32_t LookUp(const RayInGrids& ray, const MarchedSteps& steps, int64_t first) {
  const FloatTag f;
  const WordTag w;
  const auto lanes = static_cast<int64_t>(hn::Lanes(f));
  uint32_t found = 0;
  for (int64_t k = 0; k < kLookedUp; k += lanes) {
    const auto number = hn::Iota(f, static_cast<float>(first + k));
    const auto t =
        hn::Add(hn::Set(f, steps.near), hn::Mul(hn::Add(number, hn::Set(f, ray.jitter)), hn::Set(f, steps.step)));
    Floats x[3];
    for (int axis = 0; axis < 3; ++axis) {
      x[axis] = hn::Add(hn::Set(f, ray.origin[axis]), hn::Mul(t, hn::Set(f, ray.direction[axis])));
    }
    uint32_t bits = ~uint32_t{0};
    for (int v = 0; v < ray.num_views && bits != 0; ++v) {
      Floats local[3];
      MoveIntoView(ray.views[v], x, local);
      uint8_t stored[8] = {};
      hn::StoreMaskBits(w, Occupied(*ray.views[v].grid, local), stored);
      bits &= uint32_t{stored[0]} | uint32_t{stored[1]} << 8;
    }
    found |= bits << k;
  }
  return found;
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(LookUp);

uint32_t OccupiedSamples(const RayInGrids& ray, const MarchedSteps& steps, int64_t first) {
  return HWY_DYNAMIC_DISPATCH(LookUp)(ray, steps, first);
}

}  // namespace editnerf
#endif
