#include "libeditnerf/kernels/tile_mlp.h"

#include <algorithm>

#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/kernels/dense_product.h"
#include "libeditnerf/kernels/tile.h"
#include "libeditnerf/kernels/tile_layout.h"

namespace editnerf {
namespace {

// Of the two factors of a weight gradient the one with fewer rows is transposed, and the product has its other side;
// but for outputs so few that most of a vector of them would be padding.
bool HasTransposedSums(int64_t in, int64_t out) { return out < in && 2 * out >= kDensePadding; }

}  // namespace

TileMlp::TileMlp(const MlpLayers& layers, Bf16Unit bf16, bool exact) {
  for (size_t l = 0; l < layers.weights.size(); ++l) {
    Layer layer;
    layer.out = layers.weights[l].size(0);
    layer.in = layers.weights[l].size(1);
    layer.weight = layers.weights[l].data_ptr<float>();
    layer.bias = layers.biases[l].data_ptr<float>();
    layer.relu = l + 1 < layers.weights.size() || !layers.linear_output;
    activation_rows_ += layer.out;
    widest_ = std::max({widest_, PaddedWidth(layer.out), PaddedWidth(layer.in)});
    layers_.push_back(layer);
  }
  if (bf16 != Bf16Unit::kNone && !empty()) bf16_ = std::make_shared<const Bf16Mlp>(layers, bf16, exact);
}

void TileMlp::Forward(const float* input, int64_t count, float* activations, bool keep_hidden) const {
  const ThreadPhase phase(Phase::kProducts);
  if (bf16_) return bf16_->Forward(input, count, activations, keep_hidden);
  const float* before = input;
  float* after = activations;
  for (const Layer& layer : layers_) {
    DenseProduct p;
    p.rows = layer.out, p.inner = layer.in, p.columns = PaddedSamples(count);
    p.a = layer.weight, p.a_row = layer.in;
    p.b = before, p.b_row = kTileStride;
    p.c = after, p.c_row = kTileStride;
    p.bias = layer.bias;
    MultiplyDense(p, layer.relu ? DenseResult::kRowBiasRelu : DenseResult::kRowBias);
    before = after;
    after = TileRow(after, layer.out);
  }
}

void TileMlp::Backward(const float* input, const float* activations, const float* grad_out, int64_t count,
                       float* scratch, TileMlpSums& sums, c10::ArrayRef<InputGradient> grad_inputs) const {
  const ThreadPhase phase(Phase::kProducts);
  if (bf16_) return bf16_->Backward(input, activations, grad_out, count, scratch, sums, grad_inputs);
  float* next = scratch;
  float* other = TileRow(scratch, widest_);
  const float* grad = grad_out;
  int64_t row = activation_rows_;
  for (size_t l = layers_.size(); l-- > 0;) {
    const Layer& layer = layers_[l];
    row -= layer.out;
    const float* const before = l > 0 ? TileRow(activations, row - layers_[l - 1].out) : input;
    AddRowSums(grad, layer.out, count, sums.layers[l].bias.data());
    AddWeightGradient(layer, before, grad, count, sums.layers[l]);
    DenseProduct p;
    p.inner = layer.out, p.columns = PaddedSamples(count);
    p.a_row = 1, p.a_inner = layer.in;
    p.b = grad, p.b_row = kTileStride;
    p.c_row = kTileStride;
    if (l > 0) {
      p.rows = layer.in, p.a = layer.weight, p.c = next;
      p.mask = before, p.mask_row = kTileStride;
      MultiplyDense(p, DenseResult::kMask);
      grad = next;
      std::swap(next, other);
      continue;
    }
    for (const InputGradient& part : grad_inputs) {
      p.rows = part.rows, p.a = layer.weight + part.first, p.c = part.to;
      MultiplyDense(p, DenseResult::kStore);
    }
  }
}

// [out, in] = sum over samples of grad[o] before[i].
void TileMlp::AddWeightGradient(const Layer& layer, const float* before, const float* grad, int64_t count,
                                TileMlpSums::Layer& sums) const {
  // Rows of sixteen samples each hold a whole transposed column.
  thread_local std::vector<float> transposed;
  const bool swap = HasTransposedSums(layer.in, layer.out);
  const int64_t columns = swap ? layer.out : layer.in, padded = PaddedWidth(columns);
  if (transposed.size() < static_cast<size_t>(kTile * padded)) transposed.resize(static_cast<size_t>(kTile * padded));
  TransposeRows(swap ? grad : before, padded, PaddedSamples(count), transposed.data(), padded);
  DenseProduct p;
  p.rows = swap ? layer.in : layer.out, p.inner = count, p.columns = padded;
  p.a = swap ? before : grad, p.a_row = kTileStride;
  p.b = transposed.data(), p.b_row = padded;
  p.c = sums.weight.data(), p.c_row = padded;
  MultiplyDense(p, DenseResult::kAdd);
}

TileMlpSums TileMlp::MakeSums() const {
  if (bf16_) return bf16_->MakeSums();
  TileMlpSums sums;
  for (const Layer& layer : layers_) {
    const bool swap = HasTransposedSums(layer.in, layer.out);
    const int64_t rows = swap ? layer.in : layer.out, columns = PaddedWidth(swap ? layer.out : layer.in);
    sums.layers.push_back({AlignedMemory<float>(static_cast<size_t>(rows * columns)),
                           AlignedMemory<float>(static_cast<size_t>(PaddedWidth(layer.out)))});
  }
  return sums;
}

void TileMlp::AddSums(const TileMlpSums& sums, size_t index, float* weight, float* bias) const {
  if (bf16_) return bf16_->AddSums(sums, index, weight, bias);
  const Layer& layer = layers_[index];
  const bool swap = HasTransposedSums(layer.in, layer.out);
  AddLayerSums(sums.layers[index], layer.in, layer.out, PaddedWidth(swap ? layer.out : layer.in), swap, weight, bias);
}

}  // namespace editnerf
