#include "libeditnerf/kernels/bf16_product.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <stdexcept>

#include "libeditnerf/base/machine.h"
#include "libeditnerf/kernels/aligned_memory.h"
#include "libeditnerf/kernels/tile.h"

#if defined(__x86_64__) && defined(__linux__)
#define EDITNERF_BF16 1
#include <cpuid.h>
#include <immintrin.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

namespace editnerf {

uint16_t ToBf16(float value) {
  uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  if (value != value) return static_cast<uint16_t>(bits >> 16 | 0x40U);
  return static_cast<uint16_t>((bits + 0x7fffU + (bits >> 16 & 1U)) >> 16);
}

float FromBf16(uint16_t value) {
  const uint32_t bits = static_cast<uint32_t>(value) << 16;
  float result = 0;
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

std::vector<Bf16Unit> Bf16UnitsHere() {
  std::vector<Bf16Unit> units;
  if (FastestBf16() != Bf16Unit::kNone) units.push_back(Bf16Unit::kVectors);
  if (FastestBf16() == Bf16Unit::kTiles) units.push_back(Bf16Unit::kTiles);
  return units;
}

const char* NameOf(Bf16Unit unit) {
  switch (unit) {
    case Bf16Unit::kNone:
      break;
    case Bf16Unit::kVectors:
      return "AVX-512 BF16";
    case Bf16Unit::kTiles:
      return "AMX BF16";
  }
  return "no bfloat16";
}

#ifdef EDITNERF_BF16

// Highway has no such operations in the versions that distributions ship, so these are the compiler's own.
#define EDITNERF_VECTORS __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")))
#define EDITNERF_TILES __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx512bf16,amx-tile,amx-bf16")))

namespace {

bool HasVectors() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __builtin_cpu_supports("avx512bw") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
         __builtin_cpu_supports("avx512vl") != 0 && __get_cpuid_count(7, 1, &a, &b, &c, &d) != 0 && (a >> 5 & 1) != 0;
}

// The registers are large, so that Linux saves them only for processes that asked.
bool HasTiles() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0 || (d >> 22 & 1) == 0 || (d >> 24 & 1) == 0) return false;
  constexpr long kRequestPermission = 0x1023, kTileData = 18;  // ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA
  return syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0;
}

struct alignas(64) TileConfiguration {
  uint8_t palette = 1, start_row = 0, reserved[14] = {};
  uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
};
static_assert(sizeof(TileConfiguration) == 64);

// Tiles 0 to 3: a block of the result; 4 and 5: of a; 6 and 7: of b.
template <bool kTwoRows, bool kTwoColumns>
EDITNERF_TILES void TileBlock(const Bf16Product& p, int64_t row, int64_t column) {
  const auto c_stride = static_cast<size_t>(p.c_row) * sizeof(float);
  const auto a_stride = static_cast<size_t>(p.a_row) * sizeof(uint16_t);
  const auto b_stride = static_cast<size_t>(p.b_row) * sizeof(uint32_t);
  float* const c = p.c + row * p.c_row + column;
  float* const below = c + kBf16Rows * p.c_row;
  if (p.add) {
    _tile_loadd(0, c, c_stride);
    if constexpr (kTwoColumns) _tile_loadd(1, c + kBf16Rows, c_stride);
    if constexpr (kTwoRows) _tile_loadd(2, below, c_stride);
    if constexpr (kTwoRows && kTwoColumns) _tile_loadd(3, below + kBf16Rows, c_stride);
  } else {
    _tile_zero(0);
    if constexpr (kTwoColumns) _tile_zero(1);
    if constexpr (kTwoRows) _tile_zero(2);
    if constexpr (kTwoRows && kTwoColumns) _tile_zero(3);
  }
  for (int64_t k = 0; k < p.inner; k += kBf16Inner) {
    const uint16_t* const a = p.a + row * p.a_row + k;
    const uint32_t* const b = p.b + k / 2 * p.b_row + column;
    _tile_loadd(4, a, a_stride);
    _tile_loadd(6, b, b_stride);
    _tile_dpbf16ps(0, 4, 6);
    if constexpr (kTwoColumns) {
      _tile_loadd(7, b + kBf16Rows, b_stride);
      _tile_dpbf16ps(1, 4, 7);
    }
    if constexpr (kTwoRows) {
      _tile_loadd(5, a + kBf16Rows * p.a_row, a_stride);
      _tile_dpbf16ps(2, 5, 6);
    }
    if constexpr (kTwoRows && kTwoColumns) _tile_dpbf16ps(3, 5, 7);
  }
  _tile_stored(0, c, c_stride);
  if constexpr (kTwoColumns) _tile_stored(1, c + kBf16Rows, c_stride);
  if constexpr (kTwoRows) _tile_stored(2, below, c_stride);
  if constexpr (kTwoRows && kTwoColumns) _tile_stored(3, below + kBf16Rows, c_stride);
}

template <bool kTwoRows>
EDITNERF_TILES void TileBlocks(const Bf16Product& p, int64_t row) {
  int64_t column = 0;
  for (; column + 2 * kBf16Rows <= p.columns; column += 2 * kBf16Rows) TileBlock<kTwoRows, true>(p, row, column);
  if (column < p.columns) TileBlock<kTwoRows, false>(p, row, column);
}

EDITNERF_TILES void MultiplyByTiles(const Bf16Product& p) {
  int64_t row = 0;
  for (; row + 2 * kBf16Rows <= p.rows; row += 2 * kBf16Rows) TileBlocks<true>(p, row);
  if (row < p.rows) TileBlocks<false>(p, row);
}

EDITNERF_TILES void ConfigureTiles() {
  static constexpr TileConfiguration kConfiguration;
  _tile_loadconfig(&kConfiguration);
}

EDITNERF_TILES void ReleaseTiles() { _tile_release(); }

// kRows x kVectors sums in registers.
template <int kRows, int kVectors>
EDITNERF_VECTORS void VectorBlock(const Bf16Product& p, int64_t row, int64_t column) {
  __m512 sum[kRows][kVectors];
  for (int r = 0; r < kRows; ++r) {
    for (int v = 0; v < kVectors; ++v) {
      sum[r][v] = p.add ? _mm512_loadu_ps(p.c + (row + r) * p.c_row + column + 16 * v) : _mm512_setzero_ps();
    }
  }
  for (int64_t k = 0; k < p.inner; k += 2) {
    __m512bh across[kVectors];
    for (int v = 0; v < kVectors; ++v) {
      across[v] = (__m512bh)_mm512_loadu_si512(p.b + k / 2 * p.b_row + column + 16 * v);
    }
    for (int r = 0; r < kRows; ++r) {
      int32_t pair = 0;
      std::memcpy(&pair, p.a + (row + r) * p.a_row + k, sizeof pair);
      const auto factor = (__m512bh)_mm512_set1_epi32(pair);
      for (int v = 0; v < kVectors; ++v) sum[r][v] = _mm512_dpbf16_ps(sum[r][v], factor, across[v]);
    }
  }
  for (int r = 0; r < kRows; ++r) {
    for (int v = 0; v < kVectors; ++v) _mm512_storeu_ps(p.c + (row + r) * p.c_row + column + 16 * v, sum[r][v]);
  }
}

EDITNERF_VECTORS void MultiplyByVectors(const Bf16Product& p) {
  for (int64_t row = 0; row < p.rows; row += 8) {
    int64_t column = 0;
    for (; column + 32 <= p.columns; column += 32) VectorBlock<8, 2>(p, row, column);
    if (column < p.columns) VectorBlock<8, 1>(p, row, column);
  }
}

// A result of kBf16Rows x kBf16Rows for each of four tiles, or of eight rows and two vectors, by `rounds` steps of the
// inner dimension over the same operands.
EDITNERF_TILES void TileRounds(int64_t rounds, const uint16_t* a, const uint32_t* b) {
  _tile_zero(0);
  _tile_zero(1);
  _tile_zero(2);
  _tile_zero(3);
  _tile_loadd(4, a, 64);
  _tile_loadd(5, a, 64);
  _tile_loadd(6, b, 64);
  _tile_loadd(7, b, 64);
  for (int64_t i = 0; i < rounds; ++i) {
    _tile_dpbf16ps(0, 4, 6);
    _tile_dpbf16ps(1, 4, 7);
    _tile_dpbf16ps(2, 5, 6);
    _tile_dpbf16ps(3, 5, 7);
  }
}

EDITNERF_VECTORS float VectorRounds(int64_t rounds, const uint32_t* b) {
  __m512 sum[16];
  for (auto& one : sum) one = _mm512_setzero_ps();
  const auto factor = (__m512bh)_mm512_loadu_si512(b);
  for (int64_t i = 0; i < rounds; ++i) {
    for (auto& one : sum) one = _mm512_dpbf16_ps(one, factor, factor);
  }
  for (int i = 1; i < 16; ++i) sum[0] = _mm512_add_ps(sum[0], sum[i]);
  return _mm512_reduce_add_ps(sum[0]);
}

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

Bf16Unit FastestBf16() {
  static const Bf16Unit unit = [] {
    if (!HasVectors()) return Bf16Unit::kNone;
    return HasTiles() ? Bf16Unit::kTiles : Bf16Unit::kVectors;
  }();
  return unit;
}

Bf16Session::Bf16Session(Bf16Unit unit) : unit_(unit) {
  if (unit_ == Bf16Unit::kTiles) ConfigureTiles();
}

Bf16Session::~Bf16Session() {
  if (unit_ == Bf16Unit::kTiles) ReleaseTiles();
}

void MultiplyBf16(const Bf16Product& product, const Bf16Session& session) {
  if (session.unit() == Bf16Unit::kTiles) {
    MultiplyByTiles(product);
  } else {
    MultiplyByVectors(product);
  }
}

double MeasureBf16Peak(Bf16Unit unit) {
  if (unit == Bf16Unit::kNone) return 0;
  constexpr int64_t kRounds = 200'000;
  constexpr int kTries = 7;
  const bool tiles = unit == Bf16Unit::kTiles;
  const double per_round = 2.0 * (tiles ? 4 * kBf16Rows * kBf16Rows * kBf16Inner : 16 * 16 * 2);
  const Bf16Session session(unit);
  AlignedMemory<uint16_t> a(kBf16Rows * kBf16Inner);
  AlignedMemory<uint32_t> b(kBf16Rows * kBf16Rows);
  static std::atomic<float> result{0};  // so that nothing is optimised away
  double least = 1e9;
  for (int i = 0; i < kTries; ++i) {
    const double before = ThreadSeconds();
    if (tiles) {
      TileRounds(kRounds, a.data(), b.data());
    } else {
      result = result + VectorRounds(kRounds, b.data());
    }
    least = std::min(least, ThreadSeconds() - before);
  }
  return static_cast<double>(kRounds) * per_round / least;
}

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

Bf16Unit FastestBf16() { return Bf16Unit::kNone; }
double MeasureBf16Peak(Bf16Unit) { return 0; }
Bf16Session::Bf16Session(Bf16Unit unit) : unit_(unit) {}
Bf16Session::~Bf16Session() = default;
void MultiplyBf16(const Bf16Product&, const Bf16Session&) {}
void MoveBf16Rows(const Bf16Rows&) {}
void TransposeBf16Rows(const float*, int64_t, int64_t, uint32_t*, int64_t) {}

#endif

}  // namespace editnerf
