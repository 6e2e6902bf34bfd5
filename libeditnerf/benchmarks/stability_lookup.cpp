// Look-ups in flow and depth maps with holes: at pixel centres, borders and corners, beside NaN and infinity, outside.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/geometry/image_lookup.h"

namespace editnerf {
namespace {

constexpr int64_t kHeight = 12, kWidth = 16, kChannels = 2, kPositions = 300;

struct Situation {
  std::string name;
  torch::Tensor map;       // [1, H, W, 2] float64
  torch::Tensor pixel;     // [P, 2] float64
  bool has_slopes = true;  // whether no position lies where two slopes meet
};

struct LookedUpWithSlope {
  torch::Tensor value, valid, gradient;  // [P, 2], [P] bool, [P, 2]
};

std::vector<Situation> AllSituations() {
  torch::manual_seed(17);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
  const auto size = torch::tensor({static_cast<double>(kWidth), static_cast<double>(kHeight)}, torch::kFloat64);
  const auto whole = torch::randn({1, kHeight, kWidth, kChannels}, torch::kFloat64);
  const auto scattered = [&](double hole, double share) {
    const auto chosen = torch::rand({1, kHeight, kWidth, kChannels}, torch::kFloat64) < share;
    return torch::where(chosen, torch::full_like(whole, hole), whole);
  };
  const auto inside = torch::rand({kPositions, 2}, torch::kFloat64) * size;
  const auto halves = (torch::rand({kPositions, 2}, torch::kFloat64) * size * 2).round() / 2;
  const auto drawn = [](const torch::Tensor& values) {
    return values.index({torch::randint(values.size(0), {kPositions, 2}, torch::kInt64)});
  };
  const auto broken = torch::tensor({kNan, kInfinity, -kInfinity, -1e-30, -1e30, 1e30, 16.001, 4.3}, torch::kFloat64);
  return {{"inside", whole, inside},
          {"on centres, edges and corners", whole, halves, false},
          {"beside NaN", scattered(kNan, 0.05), inside},
          {"beside infinity", scattered(-kInfinity, 0.05), inside},
          {"known nowhere", torch::full_like(whole, kNan), inside},
          {"values of 1e30", whole * 1e30, inside},
          {"outside, NaN, infinite", whole, drawn(broken)}};
}

// Every pixel of the map by the share that a tent over its centre has at the position; its slope by the tents' sides.
LookedUpWithSlope Expected(const torch::Tensor& map, const torch::Tensor& pixel, const torch::Tensor& upstream) {
  LookedUpWithSlope expected = {torch::zeros({kPositions, kChannels}, torch::kFloat64),
                                torch::ones({kPositions}, torch::kBool),
                                torch::zeros({kPositions, 2}, torch::kFloat64)};
  const auto* const values = map.data_ptr<double>();
  for (int64_t p = 0; p < kPositions; ++p) {
    const Real u = pixel.data_ptr<double>()[2 * p], v = pixel.data_ptr<double>()[2 * p + 1];
    bool valid = u >= 0 && u <= kWidth && v >= 0 && v <= kHeight;
    // In the outer half pixel the image continues with its border: nothing changes along that axis.
    const Real x = std::clamp<Real>(u - 0.5L, 0, kWidth - 1), y = std::clamp<Real>(v - 0.5L, 0, kHeight - 1);
    const bool free_x = x == u - 0.5L, free_y = y == v - 0.5L;
    Real sum[kChannels] = {}, slope[2] = {};
    for (int64_t i = 0; valid && i < kHeight; ++i) {
      for (int64_t j = 0; j < kWidth; ++j) {
        const Real across = 1 - std::abs(x - j), down = 1 - std::abs(y - i);
        if (across < 0 || down < 0) continue;  // neighbours of weight 0 count: there is no slope without them
        for (int64_t c = 0; c < kChannels; ++c) {
          const Real value = values[(i * kWidth + j) * kChannels + c], g = upstream.data_ptr<double>()[2 * p + c];
          valid = valid && std::isfinite(value);
          sum[c] += across * down * value;
          if (free_x) slope[0] += g * value * down * (j > x ? 1 : -1);
          if (free_y) slope[1] += g * value * across * (i > y ? 1 : -1);
        }
      }
    }
    expected.valid[p] = valid;
    for (int64_t c = 0; valid && c < 2; ++c) {
      expected.value[p][c] = static_cast<double>(sum[c]);
      expected.gradient[p][c] = static_cast<double>(slope[c]);
    }
  }
  return expected;
}

}  // namespace

StabilityRows LookUpStability() {
  StabilityRows rows;
  for (const Situation& situation : AllSituations()) {
    for (const Precision& precision : Precisions()) {
      const auto map = situation.map.to(precision.type), pixel = situation.pixel.to(precision.type);
      const auto upstream = torch::rand({kPositions, kChannels}, torch::kFloat64).to(precision.type);
      const auto in_double = [](const torch::Tensor& tensor) { return tensor.to(torch::kFloat64).contiguous(); };
      const auto expected = Expected(in_double(map), in_double(pixel), in_double(upstream));
      const auto leaf = pixel.clone().requires_grad_(true);
      const auto found = BilinearLookUp(map, torch::zeros({kPositions}, torch::kInt64), leaf);
      const auto gradient = torch::autograd::grad({(found.value * upstream).sum()}, {leaf})[0];
      // Relative to the largest of all; a position is off by the rounding of up to so many pixels.
      const double bound = 4 * kWidth * precision.rounding;
      const auto error = [](const torch::Tensor& one, const torch::Tensor& wanted) {
        return LargestErrorOfRows(one.detach().reshape({1, -1}), wanted.reshape({1, -1}), 1e-30);
      };
      StabilityRow row = {"look-up", situation.name, "LibTorch " + precision.name, {}, {}, false};
      const bool as_said = torch::equal(found.valid, expected.valid);
      row.value = {as_said ? error(found.value, expected.value) : std::numeric_limits<double>::infinity(), bound};
      if (situation.has_slopes) row.gradient = {error(gradient, expected.gradient), bound};
      row.finite = AllFinite({found.value.detach(), gradient});
      rows.push_back(row);
    }
  }
  return rows;
}

}  // namespace editnerf
