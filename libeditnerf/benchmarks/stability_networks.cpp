// Small networks in float32 and bfloat16, with inputs from 1e-4 to 1e4.
#include <fmt/format.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <functional>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/kernels/fused_mlp.h"
#include "libeditnerf/kernels/tile_mlp.h"

namespace editnerf {
namespace {

const std::vector<int64_t> kWidths = {32, 64, 64, 16};

struct Evaluated {
  torch::Tensor out, gradient;  // [S, 16], [S, 32] with respect to the input
};

MlpLayers RandomLayers(bool biases) {
  MlpLayers layers;
  for (size_t l = 0; l + 1 < kWidths.size(); ++l) {
    const double scale = std::sqrt(2.0 / static_cast<double>(kWidths[l]));
    layers.weights.push_back(torch::randn({kWidths[l + 1], kWidths[l]}) * scale);
    layers.biases.push_back(torch::randn({kWidths[l + 1]}) * (biases ? 0.1 : 0.0));
  }
  return layers;
}

MlpLayers InPrecision(const MlpLayers& layers, at::ScalarType type) {
  MlpLayers converted = layers;
  for (auto& weight : converted.weights) weight = weight.to(type);
  for (auto& bias : converted.biases) bias = bias.to(type);
  return converted;
}

// Sample by sample in extended precision: beside its value, every neuron carries its derivatives with respect to the
// input forward, so that no gradient runs backward.
Evaluated Expected(const MlpLayers& layers, const torch::Tensor& input, const torch::Tensor& upstream) {
  const int64_t count = input.size(0);
  const auto in = static_cast<size_t>(kWidths.front());
  Evaluated expected = {torch::empty({count, kWidths.back()}, torch::kFloat64),
                        torch::zeros({count, kWidths.front()}, torch::kFloat64)};
  for (int64_t s = 0; s < count; ++s) {
    std::vector<Real> value(in), slope(in * in);
    for (size_t i = 0; i < in; ++i) {
      value[i] = input.data_ptr<double>()[static_cast<size_t>(s) * in + i];
      slope[i * in + i] = 1;
    }
    for (size_t l = 0; l < layers.weights.size(); ++l) {
      const auto *const weight = layers.weights[l].data_ptr<float>(), *const bias = layers.biases[l].data_ptr<float>();
      const auto rows = static_cast<size_t>(kWidths[l + 1]), columns = static_cast<size_t>(kWidths[l]);
      std::vector<Real> next(rows), next_slope(rows * in);
      for (size_t r = 0; r < rows; ++r) {
        next[r] = bias[r];
        for (size_t c = 0; c < columns; ++c) next[r] += static_cast<Real>(weight[r * columns + c]) * value[c];
        if (next[r] <= 0 && l + 1 < layers.weights.size()) {
          next[r] = 0;
          continue;
        }
        for (size_t c = 0; c < columns; ++c) {
          for (size_t i = 0; i < in; ++i) {
            next_slope[r * in + i] += static_cast<Real>(weight[r * columns + c]) * slope[c * in + i];
          }
        }
      }
      value = std::move(next), slope = std::move(next_slope);
    }
    for (size_t r = 0; r < value.size(); ++r) {
      const auto out = static_cast<size_t>(s) * value.size() + r;
      expected.out.data_ptr<double>()[out] = static_cast<double>(value[r]);
      for (size_t i = 0; i < in; ++i) {
        expected.gradient.data_ptr<double>()[static_cast<size_t>(s) * in + i] +=
            static_cast<double>(upstream.data_ptr<double>()[out] * slope[r * in + i]);
      }
    }
  }
  return expected;
}

using MlpFunction = at::Tensor (*)(const std::vector<at::Tensor>&, const MlpLayers&);

Evaluated Differentiated(MlpFunction evaluate, const MlpLayers& layers, const torch::Tensor& input,
                         const torch::Tensor& upstream) {
  const auto leaf = input.clone().requires_grad_(true);
  const auto out = evaluate({leaf}, layers);
  return {out.detach(), torch::autograd::grad({(out * upstream).sum()}, {leaf})[0]};
}

Evaluated ByTile(const TileMlp& network, const torch::Tensor& input, const torch::Tensor& upstream) {
  const int64_t count = input.size(0);
  TileMemory in(network.in()), activations(network.activation_rows()), upward(network.out()),
      scratch(network.scratch_rows()), gradient(network.in());
  FillTile(input.t(), &in);
  FillTile(upstream.t(), &upward);
  network.Forward(in.rows(), count, activations.rows());
  TileMlpSums sums = network.MakeSums();
  network.Backward(in.rows(), activations.rows(), upward.rows(), count, scratch.rows(), sums,
                   {InputGradient{0, network.in(), gradient.rows()}});
  TileMemory out(network.out());
  std::copy_n(activations.Row(network.output_row()), network.out() * kTileStride, out.rows());
  return {ReadTile(out, network.out(), count).t(), ReadTile(gradient, network.in(), count).t()};
}

// Bounds of value and gradient. The values' errors are the largest. Of the gradients those of all samples together are
// taken, in the Euclidean norm: where a neuron's input is nearly 0, rounding decides whether it fires, and then the
// gradient of that one sample is off by all that the neuron does.
struct Bounds {
  double value, gradient;
};
constexpr Bounds kInDouble = {1e-14, 1e-14}, kInSingle = {4e-6, 4e-6}, kRounded = {0.03, 0.15},
                 kTwoParts = {1e-4, 0.02};

double ErrorTogether(const torch::Tensor& found, const torch::Tensor& expected) {
  return (found.to(torch::kFloat64) - expected).norm().item<double>() / expected.norm().item<double>();
}

StabilityRow RowOf(const std::string& name, const std::string& variant, const Bounds& bounds, const Evaluated& found,
                   const Evaluated& expected) {
  StabilityRow row = {"small network", name, variant, {}, ErrorAndBound{}, true};
  row.value = {LargestErrorOfRows(found.out, expected.out, 1e-12), bounds.value};
  row.gradient = {ErrorTogether(found.gradient, expected.gradient), bounds.gradient};
  row.finite = AllFinite({found.out, found.gradient});
  return row;
}

}  // namespace

StabilityRows NetworkStability() {
  torch::manual_seed(7);
  StabilityRows rows;
  for (const double scale : {1e-4, 1e-2, 1.0, 1e2, 1e4}) {
    // Without biases, so that thin inputs are not lost beside them.
    const MlpLayers layers = RandomLayers(/*biases=*/scale == 1);
    const auto input = torch::randn({kTile, kWidths.front()}) * scale;
    const auto upstream = torch::randn({kTile, kWidths.back()});
    const auto expected = Expected(layers, input.to(torch::kFloat64), upstream.to(torch::kFloat64));
    const std::string name = fmt::format("inputs of {:g}", scale);
    const auto add = [&](const std::string& variant, const Bounds& bounds, const Evaluated& found) {
      rows.push_back(RowOf(name, variant, bounds, found, expected));
    };
    add("LibTorch float64", kInDouble,
        Differentiated(MlpReference, InPrecision(layers, torch::kFloat64), input.to(torch::kFloat64),
                       upstream.to(torch::kFloat64)));
    add("LibTorch float32", kInSingle, Differentiated(MlpReference, layers, input, upstream));
    ForEachInstructionSet([&](const std::string& target) {
      add("fused " + target, kInSingle, Differentiated(FusedMlp, layers, input, upstream));
      add("tile " + target, kInSingle, ByTile(TileMlp(layers), input, upstream));
    });
    for (const Bf16Unit unit : Bf16UnitsHere()) {
      if (unit == Bf16Unit::kNone) continue;
      add(NameOf(unit), kRounded, ByTile(TileMlp(layers, unit, false), input, upstream));
      add(fmt::format("{}, two parts", NameOf(unit)), kTwoParts, ByTile(TileMlp(layers, unit, true), input, upstream));
    }
  }
  return rows;
}

}  // namespace editnerf
