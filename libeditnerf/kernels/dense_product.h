// Products of small matrices that stay in the first-level caches: the layers of a small network over a tile of samples.
// SIMD chosen at run time (Highway): portable, AVX2, AVX-512.
#pragma once

#include <cstdint>

namespace editnerf {

// Rows of b, c, bias and mask are padded to a multiple of this many columns.
constexpr int64_t kDensePadding = 16;
inline int64_t PaddedWidth(int64_t width) { return (width + kDensePadding - 1) / kDensePadding * kDensePadding; }

// What becomes of a result c = (a b)[m, n].
enum class DenseResult {
  kStore,        // c
  kBias,         // c + bias[n]
  kBiasRelu,     // max(c + bias[n], 0)
  kRowBias,      // c + bias[m]
  kRowBiasRelu,  // max(c + bias[m], 0)
  kMask,         // c where mask[m, n] > 0, else 0: the gradient through a ReLU
  kAdd,          // added to what is there
};

// float32, all pointers to memory of the caller; a is read element by element through its two strides, so that it may
// be transposed; b, c and mask have rows of at least `columns` values.
struct DenseProduct {
  int64_t rows = 0, inner = 0, columns = 0;  // columns: a multiple of kDensePadding
  const float* a = nullptr;
  int64_t a_row = 0, a_inner = 1;
  const float* b = nullptr;
  int64_t b_row = 0;
  float* c = nullptr;
  int64_t c_row = 0;
  const float* bias = nullptr;  // [columns] or, for the modes with a row bias, [rows]
  const float* mask = nullptr;
  int64_t mask_row = 0;
};

void MultiplyDense(const DenseProduct& product, DenseResult result);

}  // namespace editnerf
