// Products of small matrices in bfloat16, summed in float32. bf16_rows.h makes their operands.
#pragma once

#include <cstdint>

#include "libeditnerf/kernels/bf16_unit.h"

namespace editnerf {

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

// Multiply-adds (two operations each) of operands that never leave the registers: operations per second of this thread,
// the largest of several short loops. 0 where there is no such unit.
double MeasureBf16Peak(Bf16Unit unit);

}  // namespace editnerf
