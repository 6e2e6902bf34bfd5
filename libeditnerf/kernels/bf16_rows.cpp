#include "libeditnerf/kernels/bf16_rows.h"

#include <cstring>
#include <stdexcept>

#include "libeditnerf/kernels/bf16_product.h"
#include "libeditnerf/kernels/bf16_target.h"
#include "libeditnerf/kernels/tile.h"

namespace editnerf {

#ifdef EDITNERF_BF16

namespace {

EDITNERF_VECTORS __mmask16 SamplesFrom(int64_t s, int64_t count) {
  if (count >= s + 16) return 0xffff;
  return count <= s ? __mmask16{0} : static_cast<__mmask16>((1U << (count - s)) - 1);
}

EDITNERF_VECTORS void StorePairs(__m512i even, __m512i odd, uint32_t* to) {
  const __m512i low = _mm512_set_epi16(47, 15, 46, 14, 45, 13, 44, 12, 43, 11, 42, 10, 41, 9, 40, 8, 39, 7, 38, 6, 37,
                                       5, 36, 4, 35, 3, 34, 2, 33, 1, 32, 0);
  const __m512i high = _mm512_add_epi16(low, _mm512_set1_epi16(16));
  _mm512_storeu_si512(to, _mm512_permutex2var_epi16(even, low, odd));
  _mm512_storeu_si512(to + 16, _mm512_permutex2var_epi16(even, high, odd));
}

// What a MoveRows does: one bit each.
enum Part : unsigned { kBias = 1, kRelu = 2, kMask = 4, kTo = 8, kPairs = 16, kPlain = 32, kSums = 64, kRest = 128 };

unsigned PartsOf(const Bf16Rows& p) {
  return (p.bias != nullptr ? kBias : 0U) | (p.relu ? kRelu : 0U) | (p.mask != nullptr ? kMask : 0U) |
         (p.to != nullptr ? kTo : 0U) | (p.pairs != nullptr ? kPairs : 0U) | (p.plain != nullptr ? kPlain : 0U) |
         (p.sums != nullptr ? kSums : 0U) | (p.rest != nullptr ? kRest : 0U);
}

// Thirty-two samples of a row, rounded, and what rounding takes away.
struct Samples {
  __m512i rounded, rest;
};

EDITNERF_VECTORS inline __m512 Widened(__m256i values) {
  return (__m512)_mm512_slli_epi32(_mm512_cvtepu16_epi32(values), 16);
}

template <unsigned kParts>
EDITNERF_VECTORS inline Samples MoveSamples(const Bf16Rows& p, int64_t row, int64_t s, __m512 bias, __m512* sum) {
  __m512 half[2];
  __mmask16 kept[2];
  for (int h = 0; h < 2; ++h) {
    const int64_t first = s + 16 * h;
    half[h] = _mm512_loadu_ps(p.from + row * p.stride + first);
    if constexpr ((kParts & kBias) != 0) half[h] = _mm512_add_ps(half[h], bias);
    if constexpr ((kParts & kRelu) != 0) half[h] = _mm512_max_ps(_mm512_setzero_ps(), half[h]);  // a NaN stays one
    if constexpr ((kParts & kMask) != 0) {
      const __m512 mask = _mm512_loadu_ps(TileRow(p.mask, row) + first);
      half[h] = _mm512_maskz_mov_ps(_mm512_cmp_ps_mask(mask, _mm512_setzero_ps(), _CMP_GT_OQ), half[h]);
    }
    if constexpr ((kParts & kTo) != 0) _mm512_storeu_ps(TileRow(p.to, row) + first, half[h]);
    if constexpr ((kParts & (kSums | kPlain)) != 0) kept[h] = SamplesFrom(first, p.count);
    if constexpr ((kParts & kSums) != 0) *sum = _mm512_mask_add_ps(*sum, kept[h], *sum, half[h]);
  }
  Samples samples = {_mm512_setzero_si512(), _mm512_setzero_si512()};
  if constexpr ((kParts & (kPairs | kPlain)) == 0) return samples;
  const auto packed = (__m512i)_mm512_cvtne2ps_pbh(half[1], half[0]);
  if constexpr ((kParts & kPlain) != 0) {
    const auto both = static_cast<__mmask32>(kept[0] | static_cast<uint32_t>(kept[1]) << 16);
    _mm512_storeu_si512(p.plain + row * kTile + s, _mm512_maskz_mov_epi16(both, packed));
  }
  samples.rounded = packed;
  if constexpr ((kParts & kRest) != 0) {
    const __m512 left = _mm512_sub_ps(half[0], Widened(_mm512_castsi512_si256(packed)));
    const __m512 right = _mm512_sub_ps(half[1], Widened(_mm512_extracti64x4_epi64(packed, 1)));
    samples.rest = (__m512i)_mm512_cvtne2ps_pbh(right, left);
  }
  return samples;
}

template <unsigned kParts>
EDITNERF_VECTORS void MoveRows(const Bf16Rows& p) {
  __m512 bias[2] = {_mm512_setzero_ps(), _mm512_setzero_ps()};
  for (int64_t row = 0; row < p.rows; row += 2) {
    const bool has_odd = row + 1 < p.rows;
    if constexpr ((kParts & kBias) != 0) {
      bias[0] = _mm512_set1_ps(p.bias[row]);
      bias[1] = _mm512_set1_ps(p.bias[has_odd ? row + 1 : row]);
    }
    __m512 sum[2] = {_mm512_setzero_ps(), _mm512_setzero_ps()};
    if constexpr ((kParts & kSums) != 0) {
      sum[0] = _mm512_loadu_ps(p.sums + 16 * row);
      if (has_odd) sum[1] = _mm512_loadu_ps(p.sums + 16 * (row + 1));
    }
    for (int64_t s = 0; s < p.count; s += 32) {
      const Samples even = MoveSamples<kParts>(p, row, s, bias[0], &sum[0]);
      Samples odd = {_mm512_setzero_si512(), _mm512_setzero_si512()};
      if (has_odd) odd = MoveSamples<kParts>(p, row + 1, s, bias[1], &sum[1]);
      if constexpr ((kParts & kPairs) != 0) StorePairs(even.rounded, odd.rounded, p.pairs + row / 2 * kTile + s);
      if constexpr ((kParts & kRest) != 0) StorePairs(even.rest, odd.rest, p.rest + row / 2 * kTile + s);
    }
    if constexpr ((kParts & kSums) != 0) {
      _mm512_storeu_ps(p.sums + 16 * row, sum[0]);
      if (has_odd) _mm512_storeu_ps(p.sums + 16 * (row + 1), sum[1]);
    }
  }
}

// Zeros behind the last row, up to a multiple of what products take.
void PadRows(const Bf16Rows& p) {
  const int64_t samples = PaddedBf16Inner(p.count);
  for (uint32_t* const to : {p.pairs, p.rest}) {
    for (int64_t k = (p.rows + 1) / 2; to != nullptr && k < PaddedBf16Inner(p.rows) / 2; ++k) {
      std::memset(to + k * kTile, 0, static_cast<size_t>(samples) * sizeof(uint32_t));
    }
  }
  for (int64_t row = p.rows; p.plain != nullptr && row < PaddedBf16Rows(p.rows); ++row) {
    std::memset(p.plain + row * kTile, 0, static_cast<size_t>(samples) * sizeof(uint16_t));
  }
}

// The one of kParts... that does what is asked for.
template <unsigned... kParts>
void MoveRowsAs(const Bf16Rows& p) {
  const unsigned parts = PartsOf(p);
  const bool found = ((parts == kParts && (MoveRows<kParts>(p), true)) || ...);
  if (!found) throw std::logic_error("MoveBf16Rows: this combination is not compiled");
}

// Sixteen rows of sixteen pairs.
EDITNERF_VECTORS void TransposeBlock(const __m512i rows[16], uint32_t* out, int64_t stride) {
  __m512i a[16], b[16];
  for (int i = 0; i < 16; i += 2) {
    a[i] = _mm512_unpacklo_epi32(rows[i], rows[i + 1]);
    a[i + 1] = _mm512_unpackhi_epi32(rows[i], rows[i + 1]);
  }
  for (int i = 0; i < 16; i += 4) {
    b[i] = _mm512_unpacklo_epi64(a[i], a[i + 2]);
    b[i + 1] = _mm512_unpackhi_epi64(a[i], a[i + 2]);
    b[i + 2] = _mm512_unpacklo_epi64(a[i + 1], a[i + 3]);
    b[i + 3] = _mm512_unpackhi_epi64(a[i + 1], a[i + 3]);
  }
  // b[4 g + j]: columns j, 4 + j, 8 + j, 12 + j of rows 4 g to 4 g + 3, a quarter of a vector each.
  for (int j = 0; j < 4; ++j) {
    const __m512i even_low = _mm512_shuffle_i32x4(b[j], b[4 + j], 0x88);
    const __m512i odd_low = _mm512_shuffle_i32x4(b[j], b[4 + j], 0xdd);
    const __m512i even_high = _mm512_shuffle_i32x4(b[8 + j], b[12 + j], 0x88);
    const __m512i odd_high = _mm512_shuffle_i32x4(b[8 + j], b[12 + j], 0xdd);
    _mm512_storeu_si512(out + j * stride, _mm512_shuffle_i32x4(even_low, even_high, 0x88));
    _mm512_storeu_si512(out + (8 + j) * stride, _mm512_shuffle_i32x4(even_low, even_high, 0xdd));
    _mm512_storeu_si512(out + (4 + j) * stride, _mm512_shuffle_i32x4(odd_low, odd_high, 0x88));
    _mm512_storeu_si512(out + (12 + j) * stride, _mm512_shuffle_i32x4(odd_low, odd_high, 0xdd));
  }
}

EDITNERF_VECTORS void TransposeRows(const float* rows, int64_t num_rows, int64_t count, uint32_t* out, int64_t stride) {
  for (int64_t s = 0; s < count; s += 32) {
    const __mmask16 first = SamplesFrom(s, count), second = SamplesFrom(s + 16, count);
    for (int64_t r = 0; r < num_rows; r += 16) {
      __m512i packed[16];
      for (int64_t i = 0; i < 16; ++i) {
        packed[i] = _mm512_setzero_si512();
        if (r + i >= num_rows) continue;
        const float* const row = TileRow(rows, r + i) + s;
        packed[i] =
            (__m512i)_mm512_cvtne2ps_pbh(_mm512_maskz_loadu_ps(second, row + 16), _mm512_maskz_loadu_ps(first, row));
      }
      TransposeBlock(packed, out + s / 2 * stride + r, stride);
    }
  }
}

}  // namespace

void MoveBf16Rows(const Bf16Rows& rows) {
  constexpr unsigned kHidden = kBias | kRelu | kPairs, kGradient = kSums | kMask;
  MoveRowsAs<kPairs, kPairs | kRest,                                          // an input
             kHidden, kHidden | kTo, kHidden | kRest, kHidden | kRest | kTo,  // a hidden layer's output
             kBias | kTo, kBias | kRelu | kTo,                                // the last one's
             kSums, kSums | kPairs, kSums | kPlain, kSums | kPairs | kPlain,  // its gradient
             kGradient | kPairs | kPlain, kGradient | kPairs | kTo, kGradient | kPlain, kGradient | kTo,
             kTo,     // an input's
             kPlain>  // activations for a weight's
      (rows);
  PadRows(rows);
}

void TransposeBf16Rows(const float* rows, int64_t num_rows, int64_t count, uint32_t* out, int64_t stride) {
  TransposeRows(rows, num_rows, count, out, stride);
}

#else

void MoveBf16Rows(const Bf16Rows&) {}
void TransposeBf16Rows(const float*, int64_t, int64_t, uint32_t*, int64_t) {}

#endif

}  // namespace editnerf
