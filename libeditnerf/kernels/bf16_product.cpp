#include "libeditnerf/kernels/bf16_product.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "libeditnerf/base/machine.h"
#include "libeditnerf/kernels/aligned_memory.h"
#include "libeditnerf/kernels/bf16_target.h"

namespace editnerf {

#ifdef EDITNERF_BF16

namespace {

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

}  // namespace

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

#else

double MeasureBf16Peak(Bf16Unit) { return 0; }
Bf16Session::Bf16Session(Bf16Unit unit) : unit_(unit) {}
Bf16Session::~Bf16Session() = default;
void MultiplyBf16(const Bf16Product&, const Bf16Session&) {}

#endif

}  // namespace editnerf
