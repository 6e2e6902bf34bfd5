// What the small networks' backward passes over tiles add up.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/kernels/aligned_memory.h"

namespace editnerf {

// Sums of a network's gradient over many tiles, in the layout of the products that make them.
struct TileMlpSums {
  struct Layer {
    AlignedMemory<float> weight;  // [out, in] or [in, out], padded
    AlignedMemory<float> bias;    // [out, bias_sums]
    int64_t bias_sums = 1;        // that are to be added up
  };
  std::vector<Layer> layers;

  void Clear();
  void Add(const TileMlpSums& other);
};

// Where some rows of the gradient of the input go.
struct InputGradient {
  int64_t first = 0, rows = 0;
  float* to = nullptr;  // [rows]
};

// weight [out, in] += sums, bias [out] += sums. transposed: whether the sums of the weights are [in, out].
void AddLayerSums(const TileMlpSums::Layer& sums, int64_t in, int64_t out, int64_t padded_columns, bool transposed,
                  float* weight, float* bias);

}  // namespace editnerf
