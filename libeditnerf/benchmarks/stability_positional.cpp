// Positional encoding from inside the scene's box to where no float32 has a digit left of a phase.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/field/positional_encoding.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "libeditnerf/kernels/tile_functions.h"

namespace editnerf {
namespace {

constexpr int64_t kOctaves = 8, kWidth = 3 * (1 + 2 * kOctaves);

struct Encoded {
  torch::Tensor value, gradient;  // [S, kWidth], [S, 3]
};

// What rounding does to a phase of f x: it is off by as much as x is, and no less than the sine itself.
Real ScaleOf(Real x, int64_t octave) { return std::max<Real>(1, std::ldexp(std::abs(x), static_cast<int>(octave))); }

// Sines and cosines of 2^k x as they stand, with the C library's range reduction in extended precision, which takes off
// whole periods exactly; and the gradient from them. In `scale`, what errors are relative to.
Encoded Expected(const torch::Tensor& x, const torch::Tensor& upstream, Encoded* scale) {
  const int64_t count = x.size(0);
  Encoded expected = {torch::empty({count, kWidth}, torch::kFloat64), torch::empty({count, 3}, torch::kFloat64)};
  *scale = {torch::ones_like(expected.value), torch::ones_like(expected.gradient)};
  for (int64_t s = 0; s < count; ++s) {
    auto *const value = expected.value.data_ptr<double>() + s * kWidth, *const unit = scale->value.data_ptr<double>() +
                                                                                      s * kWidth;
    const auto* const g = upstream.data_ptr<double>() + s * kWidth;
    for (int64_t axis = 0; axis < 3; ++axis) {
      const Real at = x.data_ptr<double>()[3 * s + axis];
      value[axis] = static_cast<double>(at);
      unit[axis] = static_cast<double>(std::max<Real>(1, std::abs(at)));
      Real slope = g[axis], slope_scale = 1;
      for (int64_t k = 0; k < kOctaves; ++k) {
        const Real frequency = std::ldexp(static_cast<Real>(1), static_cast<int>(k)), phase = frequency * at;
        const int64_t sine = 3 * (1 + 2 * k) + axis, cosine = sine + 3;
        value[sine] = static_cast<double>(std::sin(phase));
        value[cosine] = static_cast<double>(std::cos(phase));
        unit[sine] = unit[cosine] = static_cast<double>(ScaleOf(at, k));
        slope += frequency * (g[sine] * std::cos(phase) - g[cosine] * std::sin(phase));
        slope_scale += frequency * ScaleOf(at, k);
      }
      expected.gradient.data_ptr<double>()[3 * s + axis] = static_cast<double>(slope);
      scale->gradient.data_ptr<double>()[3 * s + axis] = static_cast<double>(slope_scale);
    }
  }
  return expected;
}

Encoded ByModule(const torch::Tensor& x, const torch::Tensor& upstream) {
  const auto leaf = x.clone().requires_grad_(true);
  const auto value = PositionalEncoding(3, kOctaves).forward(leaf);
  return {value.detach(), torch::autograd::grad({(value * upstream).sum()}, {leaf})[0]};
}

Encoded ByTile(const torch::Tensor& x, const torch::Tensor& upstream) {
  const int64_t count = x.size(0);
  TileMemory in(3), out(kWidth), upward(kWidth), gradient(3);
  FillTile(x.t(), &in);
  FillTile(upstream.t(), &upward);
  EncodeTile(in.rows(), 3, kOctaves, 1, count, out.rows());
  EncodeTileGradient(out.rows(), upward.rows(), 3, kOctaves, 1, count, gradient.rows());
  return {ReadTile(out, kWidth, count).t(), ReadTile(gradient, 3, count).t()};
}

StabilityRow RowOf(const std::string& name, const std::string& variant, double rounding, const Encoded& found,
                   const Encoded& expected, const Encoded& scale) {
  StabilityRow row = {"positional encoding", name, variant, {}, ErrorAndBound{}, true};
  const double bound = 16 * rounding;
  row.value = {LargestRelativeError(found.value / scale.value, expected.value / scale.value, 1), bound};
  row.gradient = {LargestRelativeError(found.gradient / scale.gradient, expected.gradient / scale.gradient, 1), bound};
  // Far outside a phase has no digit left, but a sine stays one.
  const double largest = found.value.slice(1, 3).abs().max().item<double>();
  row.finite = AllFinite({found.value, found.gradient}) && largest <= 1 + 8 * rounding;
  return row;
}

// A coordinate that is not finite must stay one, as its own row of the encoding, and spoil no other sample.
StabilityRow BrokenRow(const std::string& variant, const torch::Tensor& found, const torch::Tensor& clean,
                       const torch::Tensor& x) {
  const auto broken = x.isfinite().logical_not().any(1), whole = broken.logical_not();
  const bool spoilt = !torch::equal(found.index({whole}), clean.index({whole}));
  const auto own = found.slice(1, 0, 3);
  const bool lost = !torch::equal(own.isfinite(), x.isfinite());
  return {"positional encoding",
          "NaN and infinite",
          variant,
          {spoilt || lost ? std::numeric_limits<double>::infinity() : 0, 0},
          std::nullopt,
          AllFinite({found.index({whole})})};
}

struct Range {
  const char* name;
  double farthest;
};

}  // namespace

StabilityRows PositionalEncodingStability() {
  torch::manual_seed(4);
  StabilityRows rows;
  for (const Range& range :
       {Range{"inside the box", 1}, Range{"up to a period", 3.14159}, Range{"up to 100", 1e2}, Range{"up to 1e4", 1e4},
        Range{"up to 1e8", 1e8}, Range{"up to 1e30", 1e30}, Range{"up to 1e38", 1e38}}) {
    const auto x = (torch::rand({kTile, 3}, torch::kFloat64) * 2 - 1) * range.farthest;
    const auto upstream = torch::rand({kTile, kWidth}, torch::kFloat64) - 0.5;
    for (const Precision& precision : Precisions()) {
      const auto given = x.to(precision.type), factors = upstream.to(precision.type);
      Encoded scale;
      const auto expected = Expected(given.to(torch::kFloat64), factors.to(torch::kFloat64), &scale);
      const auto add = [&](const std::string& variant, const Encoded& found) {
        rows.push_back(RowOf(range.name, variant, precision.rounding, found, expected, scale));
      };
      {
        const PlainOperations plain;
        add("LibTorch " + precision.name, ByModule(given, factors));
      }
      if (precision.type != torch::kFloat32) continue;
      ForEachInstructionSet([&](const std::string& target) {
        add("module " + target, ByModule(given, factors));
        add("tile " + target, ByTile(given, factors));
      });
    }
  }
  const auto clean = torch::rand({kTile, 3});
  auto broken = clean.clone();
  broken[1][0] = std::numeric_limits<float>::quiet_NaN();
  broken[18][1] = std::numeric_limits<float>::infinity();
  broken[35][2] = -std::numeric_limits<float>::infinity();
  const auto upstream = torch::rand({kTile, kWidth});
  const auto add = [&](const std::string& variant, Encoded (*encode)(const torch::Tensor&, const torch::Tensor&)) {
    rows.push_back(BrokenRow(variant, encode(broken, upstream).value, encode(clean, upstream).value, broken));
  };
  {
    const PlainOperations plain;
    add("LibTorch float32", ByModule);
  }
  ForEachInstructionSet([&](const std::string& target) { add("tile " + target, ByTile); });
  return rows;
}

}  // namespace editnerf
