// Softmax of the key points' weights and the density's activations, where logits and pre-activations are extreme.
#include <fmt/format.h>
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/field/density_activation.h"
#include "libeditnerf/field/truncated_exp.h"
#include "libeditnerf/kernels/tile_functions.h"

namespace editnerf {
namespace {

// Weights below are as good as none: the kernel ends at e^-85 = 1e-37.
constexpr double kFaintest = 1e-28;
// Of exp(x) in units of rounding: x is a difference of logits, off by half of the last digit of up to 64.
constexpr double kExpBound = 256;
constexpr double kActivationBound = 8;  // of what is given exactly

struct Softmaxed {
  torch::Tensor weights, gradient;  // [S, N]
};

// [S, N] logits of so many samples.
struct Logits {
  std::string name;
  torch::Tensor values;
};

std::vector<Logits> AllLogits() {
  torch::manual_seed(2);
  std::vector<Logits> all;
  for (const int64_t n : {2, 7, 64}) {
    for (const double scale : {1.0, 30.0, 1e4}) {
      const auto values = (torch::rand({kTile, n}, torch::kFloat64) * 2 - 1) * scale;
      all.push_back({fmt::format("{} logits up to {:g}", n, scale), values});
    }
  }
  const auto sign = torch::ones({kTile, 64}, torch::kFloat64);
  all.push_back({"64 logits of 1e4", sign * 1e4});
  all.push_back({"64 logits of -1e4", sign * -1e4});
  auto one = sign * -1e4;
  one.select(1, 63).fill_(1e4);
  all.push_back({"one logit of 1e4 among 63 of -1e4", one});
  return all;
}

// w_i = 1 / sum_j exp(l_j - l_i), and its gradient as a sum of pairs, w_i sum_j w_j (g_i - g_j): no largest logit is
// taken off, and no mean.
Softmaxed Expected(const torch::Tensor& logits, const torch::Tensor& upstream) {
  Softmaxed expected = {torch::empty_like(logits), torch::empty_like(logits)};
  const int64_t n = logits.size(1);
  std::vector<Real> weights(static_cast<size_t>(n));
  for (int64_t s = 0; s < logits.size(0); ++s) {
    const auto *const l = logits.data_ptr<double>() + s * n, *const g = upstream.data_ptr<double>() + s * n;
    for (int64_t i = 0; i < n; ++i) {
      Real sum = 0;
      for (int64_t j = 0; j < n; ++j) sum += std::exp(static_cast<Real>(l[j]) - static_cast<Real>(l[i]));
      weights[i] = 1 / sum;
      expected.weights[s][i] = static_cast<double>(weights[i]);
    }
    for (int64_t i = 0; i < n; ++i) {
      Real sum = 0;
      for (int64_t j = 0; j < n; ++j) sum += weights[j] * (static_cast<Real>(g[i]) - static_cast<Real>(g[j]));
      expected.gradient[s][i] = static_cast<double>(weights[i] * sum);
    }
  }
  return expected;
}

StabilityRow SoftmaxRow(const std::string& name, const std::string& variant, double rounding, const Softmaxed& found,
                        const Softmaxed& expected) {
  StabilityRow row = {"softmax", name, variant, {}, ErrorAndBound{}, AllFinite({found.weights, found.gradient})};
  row.value = {LargestRelativeError(found.weights, expected.weights, kFaintest), kExpBound * rounding};
  // Gradients are differences of numbers up to 1 times a weight, and rounded as those are.
  const double difference = (found.gradient - expected.gradient).abs().max().item<double>();
  row.gradient = {row.finite ? difference : std::numeric_limits<double>::infinity(), 8 * rounding};
  return row;
}

Softmaxed ByTile(const torch::Tensor& logits, const torch::Tensor& upstream) {
  const int64_t n = logits.size(1), count = logits.size(0);
  TileMemory weights(n), gradient(n);
  FillTile(logits.t(), &weights);
  FillTile(upstream.t(), &gradient);
  Softmax(n, count, weights.rows());
  SoftmaxGradient(weights.rows(), n, count, gradient.rows());
  return {ReadTile(weights, n, count).t(), ReadTile(gradient, n, count).t()};
}

// From -1e4 to 1e4, and every 1/8 between -40 and 40.
torch::Tensor Preactivations() {
  const auto far = torch::pow(10.0, torch::linspace(-8, 4, 97, torch::kFloat64));
  return torch::cat({-far, torch::zeros({1}, torch::kFloat64), far, torch::linspace(-40, 40, 641, torch::kFloat64)});
}

struct Activated {
  torch::Tensor value, gradient;
};

template <class Formula>
torch::Tensor Each(const torch::Tensor& x, const Formula& formula) {
  auto y = torch::empty_like(x);
  for (int64_t i = 0; i < x.numel(); ++i)
    y.data_ptr<double>()[i] = static_cast<double>(formula(x.data_ptr<double>()[i]));
  return y;
}

// exp as a power of 2, within the clamp.
Real TruncatedExpOf(Real x) {
  const auto limit = static_cast<Real>(kMaxLogDensity);
  return std::exp2(std::clamp(x, -limit, limit) * static_cast<Real>(1.4426950408889634073599246810018921L));
}

StabilityRow ActivationRow(const char* operation, const std::string& variant, double rounding, const Activated& found,
                           const Activated& expected) {
  StabilityRow row = {operation, "-1e4 to 1e4", variant, {}, std::nullopt, AllFinite({found.value})};
  row.value = {LargestRelativeError(found.value, expected.value, kFaintest), kActivationBound * rounding};
  if (found.gradient.defined()) {
    row.finite = row.finite && AllFinite({found.gradient});
    row.gradient = {LargestRelativeError(found.gradient, expected.gradient, kFaintest), kActivationBound * rounding};
  }
  return row;
}

Activated Differentiated(const torch::Tensor& x, torch::Tensor (*activation)(const torch::Tensor&)) {
  const auto leaf = x.clone().requires_grad_(true);
  const auto value = activation(leaf);
  return {value.detach(), torch::autograd::grad({value.sum()}, {leaf})[0]};
}

torch::Tensor DensityByTile(const torch::Tensor& x) {
  auto density = torch::empty({x.numel()});
  for (int64_t first = 0; first < x.numel(); first += kTile) {
    const int64_t count = std::min(kTile, x.numel() - first);
    TileMemory in(1), out(1);
    FillTile(x.slice(0, first, first + count).unsqueeze(0), &in);
    DensityOf(in.rows(), 0, static_cast<float>(kMaxLogDensity), count, out.rows());
    density.slice(0, first, first + count).copy_(ReadTile(out, 1, count)[0]);
  }
  return density;
}

}  // namespace

StabilityRows SoftmaxStability() {
  StabilityRows rows;
  for (const Logits& logits : AllLogits()) {
    const auto upstream = torch::rand_like(logits.values);
    for (const Precision& precision : Precisions()) {
      const auto given = logits.values.to(precision.type), factors = upstream.to(precision.type);
      const auto expected = Expected(given.to(torch::kFloat64), factors.to(torch::kFloat64));
      const auto leaf = given.clone().requires_grad_(true);
      const auto weights = torch::softmax(leaf, -1);
      const auto gradient = torch::autograd::grad({(weights * factors).sum()}, {leaf})[0];
      rows.push_back(SoftmaxRow(logits.name, "LibTorch " + precision.name, precision.rounding,
                                {weights.detach(), gradient}, expected));
      if (precision.type != torch::kFloat32) continue;
      ForEachInstructionSet([&](const std::string& target) {
        rows.push_back(SoftmaxRow(logits.name, "tile " + target, precision.rounding, ByTile(given, factors), expected));
      });
    }
  }
  return rows;
}

StabilityRows DensityStability() {
  StabilityRows rows;
  for (const Precision& precision : Precisions()) {
    const auto x = Preactivations().to(precision.type), exact = x.to(torch::kFloat64);
    const auto clamped = Each(exact, [](Real y) { return TruncatedExpOf(y); });
    rows.push_back(ActivationRow("clamped exp", "LibTorch " + precision.name, precision.rounding,
                                 Differentiated(x, [](const torch::Tensor& y) { return TruncatedExp(y); }),
                                 {clamped, clamped}));
    if (precision.type == torch::kFloat32) {
      ForEachInstructionSet([&](const std::string& target) {
        rows.push_back(
            ActivationRow("clamped exp", "tile " + target, precision.rounding, {DensityByTile(x), {}}, {clamped, {}}));
      });
    }
    const auto soft = Each(exact, [](Real y) { return std::max<Real>(y, 0) + std::log1p(std::exp(-std::abs(y))); });
    const auto slope = Each(exact, [](Real y) { return 1 / (1 + std::exp(-y)); });
    rows.push_back(ActivationRow("softplus", "LibTorch " + precision.name, precision.rounding,
                                 Differentiated(x, [](const torch::Tensor& y) { return DensityFromPreactivation(y); }),
                                 {soft, slope}));
  }
  return rows;
}

}  // namespace editnerf
