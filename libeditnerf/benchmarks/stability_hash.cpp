// Hash encoding inside, on and far outside its cube, from tables in float32 and bfloat16.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/kernels/bf16_table.h"
#include "libeditnerf/kernels/hash_encoding.h"
#include "libeditnerf/kernels/hash_index.h"
#include "libeditnerf/kernels/tile_functions.h"

namespace editnerf {
namespace {

constexpr int64_t kLevels = 8, kTableSize = 1 << 13, kFeatures = 2 * kLevels;

struct Points {
  std::string name;
  torch::Tensor x;      // [S, 3] float64
  bool slopes = false;  // whether the gradient in x has one value there: neither at a wall between cells nor clamped
};

struct Encoded {
  torch::Tensor features, table_gradient, x_gradient;  // [S, kFeatures], [1, L T 2], [S, 3]; undefined: has none
};

using EncodeFunction = at::Tensor (*)(const at::Tensor&, const at::Tensor&, const std::vector<int64_t>&);

// Coordinates of points that lie a hundredth of a cell away from every wall of every level.
torch::Tensor AwayFromWalls(const torch::Tensor& x, const std::vector<int64_t>& resolutions) {
  auto away = torch::ones({x.size(0)}, torch::kBool);
  for (const int64_t resolution : resolutions) {
    const auto cells = x * resolution;
    away = away.logical_and(((cells - cells.round()).abs() > 0.01).all(1));
  }
  return x.index({away});
}

std::vector<Points> AllPoints(const std::vector<int64_t>& resolutions) {
  torch::manual_seed(5);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
  const auto corners = torch::tensor({0.0, 1.0, 0.5, 1e-40, 0.99999994, 1.0 / 16}, torch::kFloat64);
  const auto far = torch::tensor({-1e-30, -1e4, 1.0000001, 1e4, -1e38, 1e38}, torch::kFloat64);
  const auto broken = torch::tensor({kNan, kInfinity, -kInfinity, 0.3}, torch::kFloat64);
  const auto drawn = [](const torch::Tensor& values) {
    return values.index({torch::randint(values.size(0), {200, 3}, torch::kInt64)});
  };
  return {{"inside the cube", AwayFromWalls(torch::rand({1000, 3}, torch::kFloat64) * 0.98 + 0.01, resolutions), true},
          {"on faces, edges and walls", drawn(corners), false},
          {"far outside", drawn(far), false},
          {"NaN and infinite", drawn(broken), false}};
}

// The documented meaning of a coordinate.
Real Clamped(double x) { return std::isnan(x) ? 0 : std::clamp<Real>(x, 0, 1); }

// One interpolation along each axis in turn, from the last to the first, instead of eight products of weights. Of each
// corner, its weight is found by interpolating a table that is 1 there and 0 elsewhere.
Encoded Expected(const Points& points, const torch::Tensor& table, const torch::Tensor& upstream,
                 const std::vector<int64_t>& resolutions) {
  const int64_t count = points.x.size(0);
  Encoded expected = {torch::empty({count, kFeatures}, torch::kFloat64),
                      torch::zeros({1, kLevels * kTableSize * 2}, torch::kFloat64),
                      torch::zeros({count, 3}, torch::kFloat64)};
  std::vector<Real> to_table(static_cast<size_t>(kLevels * kTableSize * 2));
  for (int64_t s = 0; s < count; ++s) {
    Real slopes[3] = {};
    for (int64_t l = 0; l < kLevels; ++l) {
      const int64_t resolution = resolutions[static_cast<size_t>(l)];
      const hash_index::Level level(resolution, kTableSize);
      uint32_t corner[3];
      Real inside[3];
      for (int axis = 0; axis < 3; ++axis) {
        const Real cells = Clamped(points.x.data_ptr<double>()[3 * s + axis]) * resolution;
        const auto cell = std::min<int64_t>(static_cast<int64_t>(cells), resolution - 1);
        corner[axis] = static_cast<uint32_t>(cell);
        inside[axis] = cells - cell;
      }
      std::array<int64_t, 8> entries;
      for (uint32_t c = 0; c < 8; ++c) {
        const uint32_t row = level.Row(corner[1] + (c >> 1 & 1), corner[2] + (c >> 2));
        entries[c] = (l * kTableSize + level.Entry(corner[0] + (c & 1), row)) * 2;
      }
      // With `along` an axis, the slope along it.
      const auto interpolate = [&](std::array<Real, 8> v, int along) {
        for (int axis = 2, half = 4; axis >= 0; --axis, half /= 2) {
          for (int c = 0; c < half; ++c) {
            const Real step = v[c + half] - v[c];
            v[c] = axis == along ? step * resolution : v[c] + inside[axis] * step;
          }
        }
        return v[0];
      };
      for (int64_t f = 0; f < 2; ++f) {
        std::array<Real, 8> values;
        for (size_t c = 0; c < 8; ++c) values[c] = table.data_ptr<double>()[entries[c] + f];
        expected.features[s][2 * l + f] = static_cast<double>(interpolate(values, -1));
        const Real g = upstream.data_ptr<double>()[s * kFeatures + 2 * l + f];
        for (int axis = 0; axis < 3; ++axis) slopes[axis] += g * interpolate(values, axis);
        for (size_t c = 0; c < 8; ++c) {
          std::array<Real, 8> one = {};
          one[c] = 1;
          to_table[static_cast<size_t>(entries[c] + f)] += g * interpolate(one, -1);
        }
      }
    }
    for (int axis = 0; axis < 3; ++axis) expected.x_gradient[s][axis] = static_cast<double>(slopes[axis]);
  }
  std::copy(to_table.begin(), to_table.end(), expected.table_gradient.data_ptr<double>());
  return expected;
}

Encoded Found(EncodeFunction encode, const torch::Tensor& x, const torch::Tensor& table, const torch::Tensor& upstream,
              const std::vector<int64_t>& resolutions) {
  const auto points = x.clone().requires_grad_(true), entries = table.clone().requires_grad_(true);
  const auto features = encode(points, entries, resolutions);
  const auto gradients = torch::autograd::grad({(features * upstream).sum()}, {points, entries});
  return {features.detach(), gradients[1].reshape({1, -1}), gradients[0]};
}

// The kernels for tables in bfloat16, a tile of points at a time, with coordinates clamped before as in the fused pass.
// Gradients of tables are float32's.
Encoded FoundInBf16(const Points& points, const torch::Tensor& table, const torch::Tensor& upstream,
                    const std::vector<int64_t>& resolutions) {
  constexpr float kCorner[3] = {};
  Bf16Table copy;
  copy.Refresh(table);
  TileMemory x(3), unit(3), out(kFeatures), grad(kFeatures);
  std::vector<torch::Tensor> features, slopes;
  for (int64_t begin = 0; begin < points.x.size(0); begin += kTile) {
    const int64_t end = std::min(points.x.size(0), begin + kTile), count = end - begin;
    TileMemory slope(3);  // of zeros, as slopes are added
    FillTile(points.x.slice(0, begin, end).t(), &x);
    FillTile(upstream.slice(0, begin, end).t(), &grad);
    UnitCoordinates(x.rows(), kCorner, 1, count, unit.rows());
    const HashPoints at = {count, {unit.Row(0), unit.Row(1), unit.Row(2)}};
    float* const axes[3] = {slope.Row(0), slope.Row(1), slope.Row(2)};
    for (int64_t l = 0; l < kLevels; ++l) {
      const HashLevel level = {resolutions[static_cast<size_t>(l)], kTableSize};
      EncodeBf16HashLevel(at, level, copy.Level(l), out.Row(2 * l), out.Row(2 * l + 1));
      SlopeBf16HashLevel(at, level, copy.Level(l), grad.Row(2 * l), grad.Row(2 * l + 1), axes);
    }
    features.push_back(ReadTile(out, kFeatures, count).t());
    slopes.push_back(ReadTile(slope, 3, count).t());
  }
  // Those of clamped coordinates are for the caller to leave out.
  return {torch::cat(features), {}, points.slopes ? torch::cat(slopes) : torch::Tensor()};
}

StabilityRow RowOf(const Points& points, const std::string& variant, double rounding, const Encoded& found,
                   const Encoded& expected, const std::vector<int64_t>& resolutions) {
  StabilityRow row = {"hash encoding", points.name, variant, {}, ErrorAndBound{}, true};
  // A coordinate in cells is off by the rounding of up to so many.
  std::vector<double> cells;
  double slope = 0;
  for (const int64_t resolution : resolutions) {
    cells.insert(cells.end(), 2, static_cast<double>(resolution));
    slope += static_cast<double>(resolution * resolution);
  }
  const double bound = 16 * rounding;
  const auto scale = torch::tensor(cells, torch::kFloat64);
  row.value = {LargestRelativeError(found.features / scale, expected.features / scale, 1), bound};
  row.finite = AllFinite({found.features});
  double error = 0;
  if (found.table_gradient.defined()) {
    const auto to_table = [&](const Encoded& one) {
      return one.table_gradient.to(torch::kFloat64).view({kLevels, -1}) /
             scale.view({kLevels, 2}).select(1, 0).unsqueeze(1);
    };
    error = LargestRelativeError(to_table(found), to_table(expected), 1);
    row.finite = row.finite && AllFinite({found.table_gradient});
  }
  if (found.x_gradient.defined()) {
    if (points.slopes) {
      error = std::max(error, LargestRelativeError(found.x_gradient / slope, expected.x_gradient / slope, 1));
    } else if (points.name == "far outside" && found.x_gradient.abs().max().item<double>() != 0) {
      error = std::numeric_limits<double>::infinity();  // clamped coordinates have none
    }
    row.finite = row.finite && AllFinite({found.x_gradient});
  }
  row.gradient = {error, bound};
  if (!found.table_gradient.defined() && !found.x_gradient.defined()) row.gradient.reset();
  return row;
}

// What rounding the table itself costs: all points together, in the Euclidean norm. Entries are off by 2^-9 at most,
// and slopes are differences of two.
StabilityRow RowOfRounding(const Points& points, const std::string& variant, const Encoded& found,
                           const Encoded& expected) {
  const auto error = [](const torch::Tensor& one, const torch::Tensor& wanted) {
    return (one.to(torch::kFloat64) - wanted).norm().item<double>() / wanted.norm().item<double>();
  };
  StabilityRow row = {"hash encoding", points.name, variant, {}, {}, AllFinite({found.features})};
  row.value = {error(found.features, expected.features), std::ldexp(1.0, -9)};
  if (points.slopes) row.gradient = {error(found.x_gradient, expected.x_gradient), std::ldexp(1.0, -8)};
  return row;
}

}  // namespace

StabilityRows HashEncodingStability() {
  const std::vector<int64_t> resolutions = HashResolutions(kLevels, 16, 2048);
  StabilityRows rows;
  for (const Points& points : AllPoints(resolutions)) {
    const auto table = torch::rand({kLevels, kTableSize, 2}, torch::kFloat64) * 2 - 1;
    const auto upstream = torch::rand({points.x.size(0), kFeatures}, torch::kFloat64) - 0.5;
    for (const Precision& precision : Precisions()) {
      const auto given = [&](const torch::Tensor& tensor) { return tensor.to(precision.type); };
      const auto exact = [&](const torch::Tensor& tensor) { return given(tensor).to(torch::kFloat64); };
      const Points as_given = {points.name, exact(points.x), points.slopes};
      const auto expected = Expected(as_given, exact(table), exact(upstream), resolutions);
      const auto add = [&](const std::string& variant, EncodeFunction encode) {
        rows.push_back(RowOf(points, variant, precision.rounding,
                             Found(encode, given(points.x), given(table), given(upstream), resolutions), expected,
                             resolutions));
      };
      add("LibTorch " + precision.name, HashEncodeReference);
      if (precision.type == torch::kFloat64) {
        add("loops float64", HashEncode);
      } else {
        const auto in_bf16 =
            Expected(as_given, table.to(torch::kBFloat16).to(torch::kFloat64), exact(upstream), resolutions);
        ForEachInstructionSet([&](const std::string& target) {
          add("kernel " + target, HashEncode);
          const auto found = FoundInBf16(as_given, given(table), upstream, resolutions);
          rows.push_back(RowOf(points, "bfloat16 " + target, precision.rounding, found, in_bf16, resolutions));
          rows.push_back(RowOfRounding(points, "bfloat16 " + target + ", rounding too", found, expected));
        });
      }
    }
  }
  return rows;
}

}  // namespace editnerf
