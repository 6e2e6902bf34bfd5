// The SE(3) exponential from no rotation at all to many turns.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <array>
#include <cmath>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/geometry/se3.h"

namespace editnerf {
namespace {

constexpr int64_t kMotions = 24;
constexpr size_t kSize = 8;
using Matrix = std::array<std::array<Real, kSize>, kSize>;

Matrix Product(const Matrix& a, const Matrix& b) {
  Matrix product = {};
  for (size_t i = 0; i < kSize; ++i) {
    for (size_t k = 0; k < kSize; ++k) {
      for (size_t j = 0; j < kSize; ++j) product[i][j] += a[i][k] * b[k][j];
    }
  }
  return product;
}

// The exponential of any matrix: Taylor's series of m / 2^k, squared k times. No angle, no axis, no case apart.
Matrix Exponential(Matrix m) {
  Real largest = 0;
  for (const auto& row : m) {
    for (const Real value : row) largest = std::max(largest, std::abs(value));
  }
  int halvings = 0;
  for (; largest > static_cast<Real>(1) / 64; largest /= 2) ++halvings;
  for (auto& row : m) {
    for (Real& value : row) value = std::ldexp(value, -halvings);
  }
  Matrix sum = {}, term = {};
  for (size_t i = 0; i < kSize; ++i) sum[i][i] = term[i][i] = 1;
  for (int n = 1; n <= 14; ++n) {
    term = Product(term, m);
    for (size_t i = 0; i < kSize; ++i) {
      for (size_t j = 0; j < kSize; ++j) sum[i][j] += (term[i][j] /= n);
    }
  }
  for (int k = 0; k < halvings; ++k) sum = Product(sum, sum);
  return sum;
}

// Adds the 4 x 4 generator of (w, v) at a corner of m.
void AddGenerator(const double* w, const double* v, size_t row, size_t column, Matrix* m) {
  const auto at = [&](size_t i, size_t j) -> Real& { return (*m)[row + i][column + j]; };
  at(0, 1) -= w[2], at(0, 2) += w[1], at(1, 2) -= w[0];
  at(1, 0) += w[2], at(2, 0) -= w[1], at(2, 1) += w[0];
  for (size_t i = 0; i < 3; ++i) at(i, 3) += v[i];
}

struct Moved {
  torch::Tensor points, gradient;  // [S, 3] and [S, 9], with respect to w, v and x
};

// exp [[A, E], [0, A]] has the derivative of exp(A) along E in its upper right corner (Van Loan, 1978).
Moved Expected(const torch::Tensor& w, const torch::Tensor& v, const torch::Tensor& x, const torch::Tensor& upstream) {
  Moved expected = {torch::empty_like(x), torch::zeros({x.size(0), 9}, torch::kFloat64)};
  const double none[3] = {};
  for (int64_t s = 0; s < x.size(0); ++s) {
    const auto *const ws = w.data_ptr<double>() + 3 * s, *const vs = v.data_ptr<double>() + 3 * s,
                      *const xs = x.data_ptr<double>() + 3 * s, *const g = upstream.data_ptr<double>() + 3 * s;
    const Real point[4] = {xs[0], xs[1], xs[2], 1};
    for (size_t parameter = 0; parameter < 6; ++parameter) {
      double unit[3] = {};
      unit[parameter % 3] = 1;
      Matrix m = {};
      AddGenerator(ws, vs, 0, 0, &m);
      AddGenerator(ws, vs, 4, 4, &m);
      AddGenerator(parameter < 3 ? unit : none, parameter < 3 ? none : unit, 0, 4, &m);
      const Matrix exponential = Exponential(m);
      Real slope = 0;
      for (size_t i = 0; i < 3; ++i) {
        Real moved = 0;
        for (size_t j = 0; j < 4; ++j) {
          moved += exponential[i][j] * point[j];
          slope += g[i] * exponential[i][4 + j] * point[j];
        }
        expected.points[s][static_cast<int64_t>(i)] = static_cast<double>(moved);
        if (parameter < 3) {
          expected.gradient[s][static_cast<int64_t>(6 + parameter)] +=
              static_cast<double>(g[i] * exponential[i][parameter]);
        }
      }
      expected.gradient[s][static_cast<int64_t>(parameter)] = static_cast<double>(slope);
    }
  }
  return expected;
}

Moved Found(const torch::Tensor& w, const torch::Tensor& v, const torch::Tensor& x, const torch::Tensor& upstream) {
  std::vector<torch::Tensor> leaves;
  for (const auto& input : {w, v, x}) leaves.push_back(input.clone().requires_grad_(true));
  const auto points = ExpSe3(leaves[0], leaves[1], leaves[2]);
  return {points.detach(), torch::cat(torch::autograd::grad({(points * upstream).sum()}, leaves), 1)};
}

struct Angle {
  const char* name;
  double value;
};

}  // namespace

StabilityRows RigidMotionStability() {
  torch::manual_seed(3);
  StabilityRows rows;
  const std::vector<Angle> angles = {{"theta 0", 0},
                                     {"theta 1e-320", 1e-320},
                                     {"theta 1e-40", 1e-40},
                                     {"theta 1e-8", 1e-8},
                                     {"theta 1e-3", 1e-3},
                                     {"theta just below 1", 1 - 1e-6},
                                     {"theta just above 1", 1 + 1e-6},
                                     {"theta pi", M_PI},
                                     {"theta 2 pi", 2 * M_PI},
                                     {"theta 1e3", 1e3}};
  const auto randn = [] { return torch::randn({kMotions, 3}, torch::kFloat64); };
  for (const Angle& angle : angles) {
    const auto axis = randn();
    const auto w = axis / axis.norm(2, 1, true) * angle.value;
    const auto v = randn(), x = randn(), upstream = randn();
    for (const Precision& precision : Precisions()) {
      const auto given = [&](const torch::Tensor& tensor) { return tensor.to(precision.type); };
      const auto exact = [&](const torch::Tensor& tensor) { return given(tensor).to(torch::kFloat64); };
      const auto found = Found(given(w), given(v), given(x), given(upstream));
      const auto expected = Expected(exact(w), exact(v), exact(x), exact(upstream));
      // The angle is off by its own rounding, and moves everything by as much.
      const double bound = 32 * (1 + angle.value) * precision.rounding;
      StabilityRow row = {"SE(3) exponential", angle.name, "LibTorch " + precision.name, {}, ErrorAndBound{}, true};
      row.value = {LargestErrorOfRows(found.points, expected.points, 1e-3), bound};
      row.gradient = {LargestErrorOfRows(found.gradient, expected.gradient, 1e-3), bound};
      row.finite = AllFinite({found.points, found.gradient});
      rows.push_back(row);
    }
  }
  return rows;
}

}  // namespace editnerf
