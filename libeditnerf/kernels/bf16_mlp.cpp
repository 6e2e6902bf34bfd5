#include "libeditnerf/kernels/bf16_mlp.h"

#include <algorithm>

#include "libeditnerf/kernels/tile.h"

namespace editnerf {
namespace {

// Of the two factors of a weight gradient the one with fewer rows is transposed, which costs more than to pack it.
bool HasTransposedSums(int64_t in, int64_t out) { return PaddedBf16Rows(out) < PaddedBf16Rows(in); }

int64_t SumColumns(int64_t in, int64_t out) { return PaddedBf16Rows(HasTransposedSums(in, out) ? out : in); }

// Samples of a product at a time: their result goes through the first-level cache to where it is wanted.
constexpr int64_t kSamples = 32;

size_t Size(int64_t rows, int64_t columns) { return static_cast<size_t>(rows * columns); }

}  // namespace

Bf16Mlp::Bf16Mlp(const MlpLayers& layers, Bf16Unit unit, bool exact) : unit_(unit), exact_(exact) {
  for (size_t l = 0; l < layers.weights.size(); ++l) {
    Layer layer;
    layer.out = layers.weights[l].size(0);
    layer.in = layers.weights[l].size(1);
    layer.bias = layers.biases[l].data_ptr<float>();
    layer.relu = l + 1 < layers.weights.size() || !layers.linear_output;
    const int64_t forward_row = PaddedBf16Inner(layer.in), backward_row = PaddedBf16Inner(layer.out);
    layer.forward = AlignedMemory<uint16_t>(Size(PaddedBf16Rows(layer.out), forward_row));
    // Parts of the input begin at any row and are padded from there.
    layer.backward = AlignedMemory<uint16_t>(Size(PaddedBf16Rows(layer.in) + kBf16Rows, backward_row));
    if (exact) layer.rest = AlignedMemory<uint16_t>(layer.forward.size());
    const float* weight = layers.weights[l].data_ptr<float>();
    for (int64_t o = 0; o < layer.out; ++o) {
      for (int64_t i = 0; i < layer.in; ++i) {
        const uint16_t value = ToBf16(*weight);
        if (exact) layer.rest.data()[o * forward_row + i] = ToBf16(*weight - FromBf16(value));
        ++weight;
        layer.forward.data()[o * forward_row + i] = value;
        layer.backward.data()[i * backward_row + o] = value;
      }
    }
    activation_rows_ += layer.out;
    widest_ = std::max({widest_, backward_row, forward_row});
    layers_.push_back(std::move(layer));
  }
}

Bf16Mlp::Work& Bf16Mlp::WorkOfThread() const {
  thread_local Work work;
  work.pairs.Reserve(Size(widest_ / 2, kTile));
  if (exact_) work.rest.Reserve(Size(widest_ / 2, kTile));
  work.transposed.Reserve(Size(kTile / 2, widest_));
  work.plain.Reserve(Size(widest_, kTile));
  work.result.Reserve(Size(widest_, kSamples));
  return work;
}

void Bf16Mlp::Multiply(const Bf16Session& session, const uint16_t* weights, const uint16_t* rest, int64_t out,
                       int64_t in, int64_t count, Work& work, const Bf16Rows& to) {
  Bf16Product p;
  p.rows = PaddedBf16Rows(out), p.inner = PaddedBf16Inner(in);
  p.a_row = p.inner;
  p.b_row = kTile;
  p.c = work.result.data(), p.c_row = kSamples;
  Bf16Rows rows = to;
  rows.from = work.result.data(), rows.stride = kSamples, rows.rows = out;
  for (int64_t s = 0; s < count; s += kSamples) {
    rows.count = std::min(kSamples, count - s);
    p.columns = PaddedSamples(rows.count);
    p.a = weights, p.b = work.pairs.data() + s, p.add = false;
    MultiplyBf16(p, session);
    if (rest != nullptr) {
      p.add = true;
      p.a = rest;
      MultiplyBf16(p, session);
      p.a = weights, p.b = work.rest.data() + s;
      MultiplyBf16(p, session);
    }
    const auto from = [s](auto* memory) { return memory == nullptr ? nullptr : memory + s; };
    rows.mask = from(to.mask), rows.to = from(to.to);
    rows.pairs = from(to.pairs), rows.rest = from(to.rest), rows.plain = from(to.plain);
    MoveBf16Rows(rows);
  }
}

void Bf16Mlp::Forward(const float* input, int64_t count, float* activations, bool keep_hidden) const {
  const Bf16Session session(unit_);
  Work& work = WorkOfThread();
  Bf16Rows in;
  in.from = input, in.stride = kTileStride, in.rows = layers_.front().in, in.count = count;
  in.pairs = work.pairs.data();
  if (exact_) in.rest = work.rest.data();
  MoveBf16Rows(in);
  for (const Layer& layer : layers_) {
    const bool hidden = &layer != &layers_.back();
    Bf16Rows out;
    out.bias = layer.bias, out.relu = layer.relu;
    if (keep_hidden || !hidden) out.to = activations;
    if (hidden) out.pairs = work.pairs.data();  // in the place of the samples that made them
    if (hidden && exact_) out.rest = work.rest.data();
    Multiply(session, layer.forward.data(), exact_ ? layer.rest.data() : nullptr, layer.out, layer.in, count, work,
             out);
    activations = TileRow(activations, layer.out);
  }
}

void Bf16Mlp::Backward(const float* input, const float* activations, const float* grad_out, int64_t count,
                       float* scratch, TileMlpSums& sums, c10::ArrayRef<InputGradient> grad_inputs) const {
  const Bf16Session session(unit_);
  Work& work = WorkOfThread();
  int64_t row = activation_rows_;
  const float* grad = grad_out;  // where the weights' sums need it in float32
  // Gradients on their way to a layer's two products.
  const auto way = [&](size_t l) {
    Bf16Rows rows;
    rows.sums = sums.layers[l].bias.data();
    if (l > 0 || !grad_inputs.empty()) rows.pairs = work.pairs.data();
    if (HasTransposedSums(layers_[l].in, layers_[l].out)) {
      if (l + 1 < layers_.size()) rows.to = scratch;
    } else {
      rows.plain = work.plain.data();
    }
    return rows;
  };
  const size_t last = layers_.size() - 1;
  Bf16Rows out = way(last);
  out.from = grad_out, out.stride = kTileStride, out.rows = layers_[last].out, out.count = count;
  MoveBf16Rows(out);
  for (size_t l = layers_.size(); l-- > 0;) {
    const Layer& layer = layers_[l];
    row -= layer.out;
    const float* const before = l > 0 ? TileRow(activations, row - layers_[l - 1].out) : input;
    AddWeightGradient(session, layer, before, grad, count, work, sums.layers[l]);
    if (l == 0) return InputGradients(session, layer, count, work, grad_inputs);
    Bf16Rows next = way(l - 1);
    next.mask = before;
    Multiply(session, layer.backward.data(), nullptr, layer.in, layer.out, count, work, next);
    grad = scratch;
  }
}

// Of all samples at once, but for rows that fill no tile.
void Bf16Mlp::InputGradients(const Bf16Session& session, const Layer& layer, int64_t count, Work& work,
                             c10::ArrayRef<InputGradient> parts) {
  Bf16Product p;
  p.inner = PaddedBf16Inner(layer.out), p.columns = PaddedSamples(count);
  p.a_row = p.inner;
  p.b = work.pairs.data(), p.b_row = kTile;
  p.c_row = kTileStride;
  for (const InputGradient& part : parts) {
    const uint16_t* const weights = layer.backward.data() + part.first * p.a_row;
    p.rows = part.rows / kBf16Rows * kBf16Rows;
    p.a = weights, p.c = part.to;
    MultiplyBf16(p, session);
    if (p.rows == part.rows) continue;
    Bf16Rows rest;
    rest.to = TileRow(part.to, p.rows);
    Multiply(session, weights + p.rows * p.a_row, nullptr, part.rows - p.rows, layer.out, count, work, rest);
  }
}

// [out, in] = sum over samples of grad[o] before[i]. grad is packed in work.plain already unless the sums are [in,
// out].
void Bf16Mlp::AddWeightGradient(const Bf16Session& session, const Layer& layer, const float* before, const float* grad,
                                int64_t count, Work& work, TileMlpSums::Layer& sums) {
  const bool swap = HasTransposedSums(layer.in, layer.out);
  const int64_t columns = SumColumns(layer.in, layer.out);
  if (swap) {
    Bf16Rows rows;
    rows.from = before, rows.stride = kTileStride, rows.rows = layer.in, rows.count = count;
    rows.plain = work.plain.data();
    MoveBf16Rows(rows);
  }
  TransposeBf16Rows(swap ? grad : before, swap ? layer.out : layer.in, count, work.transposed.data(), columns);
  Bf16Product p;
  p.rows = PaddedBf16Rows(swap ? layer.in : layer.out), p.inner = PaddedBf16Inner(count), p.columns = columns;
  p.a = work.plain.data(), p.a_row = kTile;
  p.b = work.transposed.data(), p.b_row = columns;
  p.c = sums.weight.data(), p.c_row = columns;
  p.add = true;
  MultiplyBf16(p, session);
}

TileMlpSums Bf16Mlp::MakeSums() const {
  TileMlpSums sums;
  for (const Layer& layer : layers_) {
    const int64_t rows = PaddedBf16Rows(HasTransposedSums(layer.in, layer.out) ? layer.in : layer.out);
    sums.layers.push_back({AlignedMemory<float>(Size(rows, SumColumns(layer.in, layer.out))),
                           AlignedMemory<float>(Size(layer.out, kBf16Rows)), kBf16Rows});
  }
  return sums;
}

void Bf16Mlp::AddSums(const TileMlpSums& sums, size_t index, float* weight, float* bias) const {
  const Layer& layer = layers_[index];
  AddLayerSums(sums.layers[index], layer.in, layer.out, SumColumns(layer.in, layer.out),
               HasTransposedSums(layer.in, layer.out), weight, bias);
}

}  // namespace editnerf
