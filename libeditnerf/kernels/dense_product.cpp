#include "libeditnerf/kernels/dense_product.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/dense_product.cpp"  // compiled once for every target
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, kDensePadding>;
using Vector = hn::Vec<Tag>;

// A block of the result lives in registers: 24 of 32 with AVX-512, 12 of 16 before.
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
constexpr int kMostVectors = 4, kAccumulators = 24;
#else
constexpr int kMostVectors = 2, kAccumulators = 12;
#endif

template <DenseResult kResult>
HWY_INLINE void Finish(const DenseProduct& p, Vector sum, int64_t row, int64_t column) {
  const Tag tag;
  float* const c = p.c + row * p.c_row + column;
  // A NaN stays one, as in torch::relu.
  constexpr bool kRelu = kResult == DenseResult::kBiasRelu || kResult == DenseResult::kRowBiasRelu;
  if constexpr (kRelu) sum = hn::IfThenZeroElse(hn::Lt(sum, hn::Zero(tag)), sum);
  if constexpr (kResult == DenseResult::kAdd) sum = hn::Add(sum, hn::LoadU(tag, c));
  if constexpr (kResult == DenseResult::kMask) {
    const Vector mask = hn::LoadU(tag, p.mask + row * p.mask_row + column);
    sum = hn::IfThenElseZero(hn::Gt(mask, hn::Zero(tag)), sum);
  }
  hn::StoreU(sum, tag, c);
}

template <int kRows, int kVectors, DenseResult kResult>
HWY_INLINE void Block(const DenseProduct& p, int64_t row, int64_t column) {
  const Tag tag;
  const int64_t lanes = static_cast<int64_t>(hn::Lanes(tag));
  Vector sum[kRows][kVectors];
  for (int v = 0; v < kVectors; ++v) {
    constexpr bool kHasBias = kResult == DenseResult::kBias || kResult == DenseResult::kBiasRelu;
    const Vector start = kHasBias ? hn::LoadU(tag, p.bias + column + v * lanes) : hn::Zero(tag);
    for (int r = 0; r < kRows; ++r) sum[r][v] = start;
  }
  if constexpr (kResult == DenseResult::kRowBias || kResult == DenseResult::kRowBiasRelu) {
    for (int r = 0; r < kRows; ++r) {
      for (int v = 0; v < kVectors; ++v) sum[r][v] = hn::Set(tag, p.bias[row + r]);
    }
  }
  const float* a = p.a + row * p.a_row;
  const float* b = p.b + column;
  for (int64_t k = 0; k < p.inner; ++k, a += p.a_inner, b += p.b_row) {
    Vector across[kVectors];
    for (int v = 0; v < kVectors; ++v) across[v] = hn::LoadU(tag, b + v * lanes);
    for (int r = 0; r < kRows; ++r) {
      const Vector factor = hn::Set(tag, a[r * p.a_row]);
      for (int v = 0; v < kVectors; ++v) sum[r][v] = hn::MulAdd(factor, across[v], sum[r][v]);
    }
  }
  for (int r = 0; r < kRows; ++r) {
    for (int v = 0; v < kVectors; ++v) Finish<kResult>(p, sum[r][v], row + r, column + v * lanes);
  }
}

template <int kVectors, DenseResult kResult>
HWY_INLINE void Rows(const DenseProduct& p, int64_t column) {
  // One vector wide, sixteen rows divide the usual widths without a rest of narrow blocks.
  constexpr int kMost = kAccumulators / kVectors, kRows = kMost > 16 ? 16 : kMost, kFewer = kRows > 6 ? 4 : 2;
  int64_t row = 0;
  for (; row + kRows <= p.rows; row += kRows) Block<kRows, kVectors, kResult>(p, row, column);
  for (; row + kFewer <= p.rows; row += kFewer) Block<kFewer, kVectors, kResult>(p, row, column);
  for (; row < p.rows; ++row) Block<1, kVectors, kResult>(p, row, column);
}

template <DenseResult kResult>
void Multiply(const DenseProduct& p) {
  const int64_t lanes = static_cast<int64_t>(hn::Lanes(Tag()));
  int64_t column = 0;
  for (; column + kMostVectors * lanes <= p.columns; column += kMostVectors * lanes) {
    Rows<kMostVectors, kResult>(p, column);
  }
  if constexpr (kMostVectors > 3) {
    for (; column + 3 * lanes <= p.columns; column += 3 * lanes) Rows<3, kResult>(p, column);
  }
  for (; column + 2 * lanes <= p.columns; column += 2 * lanes) Rows<2, kResult>(p, column);
  for (; column < p.columns; column += lanes) Rows<1, kResult>(p, column);
}

void MultiplyBy(const DenseProduct& p, DenseResult result) {
  switch (result) {
    case DenseResult::kStore:
      return Multiply<DenseResult::kStore>(p);
    case DenseResult::kBias:
      return Multiply<DenseResult::kBias>(p);
    case DenseResult::kBiasRelu:
      return Multiply<DenseResult::kBiasRelu>(p);
    case DenseResult::kRowBias:
      return Multiply<DenseResult::kRowBias>(p);
    case DenseResult::kRowBiasRelu:
      return Multiply<DenseResult::kRowBiasRelu>(p);
    case DenseResult::kMask:
      return Multiply<DenseResult::kMask>(p);
    case DenseResult::kAdd:
      return Multiply<DenseResult::kAdd>(p);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(MultiplyBy);

void MultiplyDense(const DenseProduct& product, DenseResult result) {
  HWY_DYNAMIC_DISPATCH(MultiplyBy)(product, result);
}

}  // namespace editnerf
#endif
