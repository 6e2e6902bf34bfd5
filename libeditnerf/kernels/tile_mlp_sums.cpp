#include "libeditnerf/kernels/tile_mlp_sums.h"

namespace editnerf {

void TileMlpSums::Clear() {
  for (Layer& layer : layers) {
    layer.weight.Clear();
    layer.bias.Clear();
  }
}

void TileMlpSums::Add(const TileMlpSums& other) {
  const auto add = [](const AlignedMemory<float>& from, AlignedMemory<float>& to) {
    for (size_t i = 0; i < to.size(); ++i) to.data()[i] += from.data()[i];
  };
  for (size_t l = 0; l < layers.size(); ++l) {
    add(other.layers[l].weight, layers[l].weight);
    add(other.layers[l].bias, layers[l].bias);
  }
}

void AddLayerSums(const TileMlpSums::Layer& sums, int64_t in, int64_t out, int64_t padded_columns, bool transposed,
                  float* weight, float* bias) {
  const float *const from = sums.weight.data(), *const from_bias = sums.bias.data();
  for (int64_t o = 0; o < out; ++o) {
    for (int64_t i = 0; i < in; ++i) {
      weight[o * in + i] += from[transposed ? i * padded_columns + o : o * padded_columns + i];
    }
    for (int64_t i = 0; i < sums.bias_sums; ++i) bias[o] += from_bias[o * sums.bias_sums + i];
  }
}

}  // namespace editnerf
