// A small multi-layer perceptron over one tile of samples (tile.h), with the activations kept for the backward pass.
#pragma once

#include <c10/util/ArrayRef.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "libeditnerf/kernels/bf16_mlp.h"
#include "libeditnerf/kernels/fused_mlp.h"
#include "libeditnerf/kernels/tile_mlp_sums.h"

namespace editnerf {

class TileMlp {
 public:
  TileMlp() = default;  // no network at all
  // Reads the tensors' memory, which must outlive this: float32, contiguous, on the CPU. With a unit, one that this
  // processor has, products are in bfloat16, and changes to the weights are not seen; `exact`: as bf16_mlp.h has it.
  explicit TileMlp(const MlpLayers& layers, Bf16Unit bf16 = Bf16Unit::kNone, bool exact = false);

  bool empty() const { return layers_.empty(); }
  int64_t in() const { return layers_.front().in; }
  int64_t out() const { return layers_.back().out; }
  int64_t activation_rows() const { return activation_rows_; }  // of all layers, the output last
  int64_t output_row() const { return activation_rows_ - out(); }
  int64_t scratch_rows() const { return 2 * widest_; }  // that Backward needs

  // input [in rows] -> activations [activation_rows()]. Without keep_hidden, all but the output may be left as they
  // are, and there is no way back.
  void Forward(const float* input, int64_t count, float* activations, bool keep_hidden = true) const;

  // Adds to the sums of the weights' gradients and writes the parts of the input's gradient that are asked for, given
  // that of the output [out rows]. The output layer must be linear. scratch: [scratch_rows()].
  void Backward(const float* input, const float* activations, const float* grad_out, int64_t count, float* scratch,
                TileMlpSums& sums, c10::ArrayRef<InputGradient> grad_inputs) const;

  TileMlpSums MakeSums() const;

  // Adds the sums to gradients [out, in] and [out] of layer `layer`.
  void AddSums(const TileMlpSums& sums, size_t layer, float* weight, float* bias) const;

 private:
  struct Layer {
    int64_t in, out;
    const float *weight, *bias;
    bool relu;
  };
  void AddWeightGradient(const Layer& layer, const float* before, const float* grad, int64_t count,
                         TileMlpSums::Layer& sums) const;

  std::vector<Layer> layers_;
  std::shared_ptr<const Bf16Mlp> bf16_;  // nullptr: products are in float32
  int64_t activation_rows_ = 0, widest_ = 0;
};

}  // namespace editnerf
