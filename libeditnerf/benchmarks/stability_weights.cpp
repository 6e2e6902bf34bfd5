// The key points' weights from a point to the softmax: encoding, network and distances from the tracks, for 2 to 64 key
// points that move apart, together or on a line, with logits of up to 1e4, and for points far outside.
#include <fmt/format.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/field/weight_network.h"
#include "libeditnerf/kernels/tile_functions.h"
#include "libeditnerf/kernels/tile_mlp.h"

namespace editnerf {
namespace {

constexpr int64_t kPoints = 64, kFrames = 16;
constexpr size_t kAnchors = 8;  // of a track, as the network takes them
constexpr double kPrior = 8;
using Complex = std::complex<Real>;
using Layer = std::vector<Complex>;

struct Situation {
  std::string name;
  torch::Tensor tracks;    // [T, N, 3] float64
  torch::Tensor x;         // [S, 3] float64
  double logits = 1;       // of the network, at most
  bool has_slopes = true;  // no point lies on a track, where distances have a kink
};

// Parameters and buffers in double, as the variants have them.
struct Network {
  std::vector<torch::Tensor> weights, biases;
  torch::Tensor anchors;
  double prior = 0;  // divided by the spacing
};

struct Weighted {
  torch::Tensor weights, gradient;  // [S, N], [S, 3]
  double logit = 0, slope = 0;      // the largest of all, and of their slopes
};

std::vector<Situation> AllSituations() {
  const auto points = [](double size) { return (torch::rand({kPoints, 3}, torch::kFloat64) * 2 - 1) * size; };
  const auto tracks = [](int64_t n) { return torch::rand({kFrames, n, 3}, torch::kFloat64) * 2 - 1; };
  std::vector<Situation> all;
  for (const int64_t n : {2, 8, 64}) {
    for (const double logits : {1.0, 1e4}) {
      all.push_back({fmt::format("{} key points, logits to {:g}", n, logits), tracks(n), points(1), logits});
    }
  }
  const auto together = tracks(1).expand({kFrames, 8, 3}).contiguous();
  const auto apart = torch::linspace(-1, 1, 8, torch::kFloat64).view({1, 8, 1});
  const auto line = (torch::tensor({1.0, 0.5, -0.25}, torch::kFloat64) * apart).expand({kFrames, 8, 3}).contiguous();
  all.push_back({"8 coincident", together, points(1)});
  all.push_back({"8 on a line, still", line, points(1)});
  all.push_back({"8 on a line, points on them", line, line[0].repeat({kPoints / 8, 1}), 1, false});
  all.push_back({"8, scene of 1e-4", tracks(8) * 1e-4, points(1e-4)});
  all.push_back({"8, scene of 1e4", tracks(8) * 1e4, points(1e4)});
  all.push_back({"8, points 1e4 outside", tracks(8), points(1e4)});
  return all;
}

Network InDouble(const WeightNetwork& network) {
  Network copy;
  const auto parameters = network->named_parameters();
  const auto in_double = [](const torch::Tensor& tensor) { return tensor.detach().to(torch::kFloat64).contiguous(); };
  for (const auto& item : parameters) {
    auto& list = item.key().find("weight") != std::string::npos ? copy.weights : copy.biases;
    list.push_back(in_double(item.value()));
  }
  copy.anchors = in_double(network->named_buffers()["anchors"]);
  copy.prior = kPrior / in_double(network->named_buffers()["spacing"]).item<double>();
  return copy;
}

// Layer by layer with sines of 2^k x as they stand; logits as distances and products give them, and slopes by a step
// along the imaginary axis.
Layer Logits(const Network& network, const std::array<Complex, 3>& x) {
  Layer values(x.begin(), x.end());
  for (int k = 0; k < WeightNetworkConfig().num_octaves; ++k) {
    for (const bool cosine : {false, true}) {
      for (const Complex& one : x) {
        const Complex phase = one * std::ldexp(static_cast<Real>(1), k);
        values.push_back(cosine ? std::cos(phase) : std::sin(phase));
      }
    }
  }
  for (size_t l = 0; l < network.weights.size(); ++l) {
    const auto rows = static_cast<size_t>(network.weights[l].size(0)), columns = values.size();
    Layer next(rows);
    for (size_t r = 0; r < rows; ++r) {
      next[r] = static_cast<Real>(network.biases[l].data_ptr<double>()[r]);
      for (size_t c = 0; c < columns; ++c) {
        next[r] += static_cast<Real>(network.weights[l].data_ptr<double>()[r * columns + c]) * values[c];
      }
      if (l + 1 < network.weights.size() && next[r].real() <= 0) next[r] = 0;
    }
    values = std::move(next);
  }
  for (size_t i = 0; i < values.size(); ++i) {
    Complex nearest = std::numeric_limits<Real>::max();
    for (size_t a = 0; a < kAnchors; ++a) {
      Complex square = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        const Complex apart =
            x[axis] - static_cast<Real>(network.anchors.data_ptr<double>()[(i * kAnchors + a) * 3 + axis]);
        square += apart * apart;
      }
      const Complex distance = std::sqrt(square);
      if (distance.real() < nearest.real()) nearest = distance;
    }
    values[i] -= static_cast<Real>(network.prior) * nearest;
  }
  return values;
}

// A network whose logits, without the distances, are as large as the situation wants them at the worst of its points.
WeightNetwork NetworkOf(const Situation& situation, const Precision& precision) {
  torch::manual_seed(16);
  WeightNetworkConfig config;
  config.output_init = 1;
  config.distance_prior = kPrior;
  WeightNetwork network(config, situation.tracks.size(1), situation.tracks);
  Network alone = InDouble(network);
  alone.prior = 0;
  double largest = 0;
  for (int64_t s = 0; s < kPoints; ++s) {
    const double* const x = situation.x.data_ptr<double>() + 3 * s;
    for (const Complex& logit : Logits(alone, {x[0], x[1], x[2]})) {
      largest = std::max(largest, static_cast<double>(std::abs(logit.real())));
    }
  }
  const torch::NoGradGuard no_grad;
  network->named_parameters()["mlp.output.weight"].mul_(situation.logits / largest);
  network->to(precision.type);
  return network;
}

// w_i = 1 / sum_j exp(l_j - l_i).
Layer Softmaxed(const Layer& logits) {
  constexpr Real kBeyond = 11000;  // exp overflows
  Layer weights(logits.size());
  for (size_t i = 0; i < logits.size(); ++i) {
    Complex sum = 0;
    bool none = false;
    for (const Complex& other : logits) {
      none = none || (other - logits[i]).real() > kBeyond;
      if (!none) sum += std::exp(other - logits[i]);
    }
    weights[i] = none ? Complex() : static_cast<Real>(1) / sum;
  }
  return weights;
}

Weighted Expected(const Network& network, const torch::Tensor& x, const torch::Tensor& upstream) {
  const int64_t number = upstream.size(1);
  const Real step = std::pow(static_cast<Real>(10), -40);
  Weighted expected = {torch::empty({kPoints, number}, torch::kFloat64), torch::zeros({kPoints, 3}, torch::kFloat64)};
  for (int64_t s = 0; s < kPoints; ++s) {
    for (size_t axis = 0; axis < 3; ++axis) {
      std::array<Complex, 3> at;
      for (size_t i = 0; i < 3; ++i) at[i] = {x.data_ptr<double>()[3 * s + i], i == axis ? step : 0};
      const Layer logits = Logits(network, at), weights = Softmaxed(logits);
      Real slope = 0;
      for (int64_t i = 0; i < number; ++i) {
        const Complex &logit = logits[static_cast<size_t>(i)], &weight = weights[static_cast<size_t>(i)];
        expected.weights[s][i] = static_cast<double>(weight.real());
        slope += static_cast<Real>(upstream.data_ptr<double>()[s * number + i]) * weight.imag() / step;
        expected.logit = std::max(expected.logit, static_cast<double>(std::abs(logit.real())));
        expected.slope = std::max(expected.slope, static_cast<double>(std::abs(logit.imag() / step)));
      }
      expected.gradient[s][static_cast<int64_t>(axis)] = static_cast<double>(slope);
    }
  }
  return expected;
}

torch::Tensor ByTile(const WeightNetwork& network, const torch::Tensor& x) {
  FusedField field;
  network->AddTo(&field);
  const TileMlp mlp(field.weights);
  const int64_t number = mlp.out();
  TileMemory points(3), encoded(mlp.in()), activations(mlp.activation_rows());
  FillTile(x.t(), &points);
  EncodeTile(points.rows(), 3, field.weight_octaves, 1, kPoints, encoded.rows());
  mlp.Forward(encoded.rows(), kPoints, activations.rows());
  TileMemory weights(number);
  std::copy_n(activations.Row(mlp.output_row()), number * kTileStride, weights.rows());
  SubtractDistances(points.rows(), field.anchors.data_ptr<float>(), number, kAnchors, field.prior, kPoints,
                    weights.rows());
  Softmax(number, kPoints, weights.rows());
  return ReadTile(weights, number, kPoints).t();
}

}  // namespace

StabilityRows KeyPointWeightStability() {
  torch::manual_seed(15);
  StabilityRows rows;
  for (const Situation& situation : AllSituations()) {
    const auto drawn = torch::rand({kPoints, situation.tracks.size(1)}, torch::kFloat64) * 2 - 1;
    for (const Precision& precision : Precisions()) {
      const auto x = situation.x.to(precision.type), upstream = drawn.to(precision.type);
      WeightNetwork network = NetworkOf(situation, precision);
      const Weighted expected =
          Expected(InDouble(network), x.to(torch::kFloat64), upstream.to(torch::kFloat64).contiguous());
      // A weight is off by as much as differences of the logits are: by the rounding of the largest, and of points far
      // outside by what the encoding has left of a phase.
      const double farthest = x.abs().max().item<double>();
      const double bound = 4 * precision.rounding * (1 + expected.logit + farthest);
      const auto add = [&](const std::string& variant, const torch::Tensor& weights, const torch::Tensor& gradient) {
        StabilityRow row = {"key point weights", situation.name, variant, {}, {}, AllFinite({weights})};
        row.value = {LargestRelativeError(weights, expected.weights, 1), bound};
        if (gradient.defined()) {
          row.finite = row.finite && AllFinite({gradient});
          if (situation.has_slopes) {
            row.gradient = {LargestRelativeError(gradient, expected.gradient, expected.slope), bound};
          }
        }
        rows.push_back(row);
      };
      const auto leaf = x.clone().requires_grad_(true);
      const auto weights = network->forward(leaf);
      add("LibTorch " + precision.name, weights.detach(),
          torch::autograd::grad({(weights * upstream).sum()}, {leaf})[0]);
      if (precision.type == torch::kFloat64) continue;
      ForEachInstructionSet([&](const std::string& target) { add("kernel " + target, ByTile(network, x), {}); });
    }
  }
  return rows;
}

}  // namespace editnerf
