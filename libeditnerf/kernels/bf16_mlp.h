// A small multi-layer perceptron over one tile of samples with products in bfloat16: activations, gradients and the
// weights' sums are float32, and rounded on their way into a product alone. Where outputs have to be as exact as those
// of float32, products are of two parts of every number, 16 bits together, and cost three times as much:
//   (W + dW) (h + dh) = W h + W dh + dW h;   gradients are rounded all the same.
#pragma once

#include <c10/util/ArrayRef.h>

#include <cstdint>
#include <vector>

#include "libeditnerf/kernels/aligned_memory.h"
#include "libeditnerf/kernels/bf16_product.h"
#include "libeditnerf/kernels/bf16_rows.h"
#include "libeditnerf/kernels/fused_mlp.h"
#include "libeditnerf/kernels/tile_mlp_sums.h"

namespace editnerf {

class Bf16Mlp {
 public:
  // Packs the weights, so that changes to them are not seen. unit: one that this processor has.
  Bf16Mlp(const MlpLayers& layers, Bf16Unit unit, bool exact);

  // As TileMlp's.
  void Forward(const float* input, int64_t count, float* activations, bool keep_hidden) const;
  void Backward(const float* input, const float* activations, const float* grad_out, int64_t count, float* scratch,
                TileMlpSums& sums, c10::ArrayRef<InputGradient> grad_inputs) const;
  TileMlpSums MakeSums() const;
  void AddSums(const TileMlpSums& sums, size_t layer, float* weight, float* bias) const;

 private:
  struct Layer {
    int64_t in, out;
    const float* bias;
    bool relu;
    AlignedMemory<uint16_t> forward;   // [padded out, padded in]
    AlignedMemory<uint16_t> rest;      // the same of what rounding took away; empty unless products are exact
    AlignedMemory<uint16_t> backward;  // [padded in and sixteen more, padded out], transposed
  };
  // What a thread needs between products.
  struct Work {
    AlignedMemory<uint32_t> pairs, rest, transposed;
    AlignedMemory<uint16_t> plain;
    AlignedMemory<float> result;  // of a few samples
  };
  Work& WorkOfThread() const;
  // A layer's product with work.pairs, a few samples at a time, each through `to`.
  static void Multiply(const Bf16Session& session, const uint16_t* weights, const uint16_t* rest, int64_t out,
                       int64_t in, int64_t count, Work& work, const Bf16Rows& to);
  static void InputGradients(const Bf16Session& session, const Layer& layer, int64_t count, Work& work,
                             c10::ArrayRef<InputGradient> parts);
  static void AddWeightGradient(const Bf16Session& session, const Layer& layer, const float* before, const float* grad,
                                int64_t count, Work& work, TileMlpSums::Layer& sums);

  Bf16Unit unit_;
  bool exact_;
  std::vector<Layer> layers_;
  int64_t activation_rows_ = 0, widest_ = 0;
};

}  // namespace editnerf
