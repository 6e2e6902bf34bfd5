// Products of small matrices in bfloat16, summed in float32, by the instructions that some processors have for them:
// tiles (AMX), or pairs in vectors (AVX-512 BF16). The operands are made here from the rows of a tile (tile.h).
#pragma once

#include <cstdint>
#include <vector>

namespace editnerf {

enum class Bf16Unit {
  kNone,
  kVectors,  // vdpbf16ps: twice float32's speed on some processors, half of it on others
  kTiles,    // tdpbf16ps: about ten times
};

// The fastest that this processor has. Asks the system once for leave to use tiles.
Bf16Unit FastestBf16();

std::vector<Bf16Unit> Bf16UnitsHere();  // all that it has, the fastest last

// "no bfloat16", "AVX-512 BF16", "AMX BF16".
const char* NameOf(Bf16Unit unit);

// Multiply-adds (two operations each) of operands that never leave the registers: operations per second of this thread,
// the largest of several short loops. 0 where there is no such unit.
double MeasureBf16Peak(Bf16Unit unit);

constexpr int64_t kBf16Rows = 16;   // multiples of which results have, rows and columns
constexpr int64_t kBf16Inner = 32;  // and which the inner dimension has

inline int64_t PaddedBf16Rows(int64_t rows) { return (rows + kBf16Rows - 1) / kBf16Rows * kBf16Rows; }
inline int64_t PaddedBf16Inner(int64_t inner) { return (inner + kBf16Inner - 1) / kBf16Inner * kBf16Inner; }

// While one lives, its thread multiplies by `unit`, one that this processor has. They do not nest.
class Bf16Session {
 public:
  explicit Bf16Session(Bf16Unit unit);
  ~Bf16Session();
  Bf16Session(const Bf16Session&) = delete;
  Bf16Session& operator=(const Bf16Session&) = delete;
  Bf16Unit unit() const { return unit_; }

 private:
  Bf16Unit unit_;
};

// c = a b, or with `add` c += a b. Strides in elements.
struct Bf16Product {
  int64_t rows = 0, inner = 0, columns = 0;  // padded
  const uint16_t* a = nullptr;               // [rows, inner]
  int64_t a_row = 0;
  const uint32_t* b = nullptr;  // [inner / 2, columns]: rows 2 k and 2 k + 1, the former in the lower halves
  int64_t b_row = 0;
  float* c = nullptr;
  int64_t c_row = 0;
  bool add = false;
};

void MultiplyBf16(const Bf16Product& product, const Bf16Session& session);

// Rows of samples on their way from one product to the next. What is nullptr is left out.
struct Bf16Rows {
  const float* from = nullptr;  // [rows] of `stride` floats
  int64_t stride = 0;
  int64_t rows = 0, count = 0;  // count: samples, at most kTile
  const float* bias = nullptr;  // [rows], added
  bool relu = false;
  const float* mask = nullptr;  // [rows] of a tile: values stay where it is positive
  float* to = nullptr;          // [rows] of a tile
  uint32_t* pairs = nullptr;    // [padded rows / 2, kTile], as the b of a product over the rows; 0 behind the last
  uint32_t* rest = nullptr;     // the same of what rounding took away
  uint16_t* plain = nullptr;    // [padded rows, kTile], as the a of a product over samples; 0 behind the last of both
  float* sums = nullptr;        // [rows, 16], added: over the samples, sixteen sums of a row that are to be added up
};

void MoveBf16Rows(const Bf16Rows& rows);

// out [kTile / 2, stride]: row k holds samples 2 k and 2 k + 1 of every row of a tile, as the b of a product over the
// samples; 0 behind the last, up to padded samples and rows.
void TransposeBf16Rows(const float* rows, int64_t num_rows, int64_t count, uint32_t* out, int64_t stride);

// To the nearest bfloat16, ties to even; a NaN stays one.
uint16_t ToBf16(float value);
float FromBf16(uint16_t value);

}  // namespace editnerf
