#include "libeditnerf/geometry/se3.h"

#include <torch/types.h>

#include <cmath>

#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

const double kPi = std::acos(-1.0);

torch::Tensor Vector(double x, double y, double z) { return torch::tensor({x, y, z}, torch::kFloat64); }

// exp of the 4 x 4 twist matrix, by LibTorch's own algorithm.
torch::Tensor MatrixExponential(const torch::Tensor& w, const torch::Tensor& v, const torch::Tensor& x) {
  auto twist = torch::zeros({4, 4}, torch::kFloat64);
  const double a = w[0].item<double>(), b = w[1].item<double>(), c = w[2].item<double>();
  twist[0][1] = -c, twist[0][2] = b, twist[1][0] = c, twist[1][2] = -a, twist[2][0] = -b, twist[2][1] = a;
  for (int i = 0; i < 3; ++i) twist[i][3] = v[i];
  return torch::matrix_exp(twist).matmul(torch::cat({x, torch::ones({1}, torch::kFloat64)})).narrow(0, 0, 3);
}

}  // namespace

TEST_CASE("a quarter turn about z maps x to y") {
  CHECK(ExpSe3(Vector(0, 0, kPi / 2), Vector(0, 0, 0), Vector(1, 0, 0)).allclose(Vector(0, 1, 0)));
  CHECK(ExpSo3(Vector(0, 0, kPi / 2), Vector(1, 0, 0)).allclose(Vector(0, 1, 0)));
}

TEST_CASE("the screw motion is the exponential of its twist at every angle") {
  const auto axis = Vector(0.3, -0.5, 0.8) / std::sqrt(0.98);
  const auto v = Vector(0.4, 0.1, -0.7), x = Vector(-1.2, 0.6, 0.9);
  for (const double angle : {0.0, 5e-324, 1e-160, 1e-9, 1e-4, 0.3, 0.999999, 1.000001, 2.0, kPi, 2 * kPi, 7.5}) {
    const auto found = ExpSe3(axis * angle, v, x);
    CHECK((found - MatrixExponential(axis * angle, v, x)).abs().max().item<double>() < 1e-12);
  }
  // 1000 radians, where the series of a matrix exponential loses its digits: the turn modulo 2 pi.
  const auto turned = ExpSo3(axis * 1e3, x);
  CHECK(turned.allclose(ExpSo3(axis * std::fmod(1e3, 2 * kPi), x), 1e-11, 1e-11));
}

TEST_CASE("screw coefficients are accurate on both sides of the series' end") {
  for (const double squared : {0.0, 1e-300, 1e-12, 0.5, 1.0 - 1e-12, 1.0, 1.0 + 1e-12, 4.0, 1e6}) {
    const long double theta = std::sqrt(static_cast<long double>(squared));
    const auto k = ScrewCoefficientsOf(torch::tensor({squared}, torch::kFloat64));
    long double a = 1, b = 0.5L, c = 1 / 6.0L;
    if (theta > 1e-3L) {
      a = std::sin(theta) / theta;
      b = 2 * std::pow(std::sin(theta / 2), 2) / (theta * theta);
      c = (theta - std::sin(theta)) / (theta * theta * theta);
    }
    CHECK(k.a.item<double>() == Approx(static_cast<double>(a)).epsilon(1e-11));
    CHECK(k.b.item<double>() == Approx(static_cast<double>(b)).epsilon(1e-11));
    CHECK(k.c.item<double>() == Approx(static_cast<double>(c)).epsilon(1e-11));
  }
}

TEST_CASE("the screw motion has exact gradients at zero, denormal, small, half and many turns") {
  const auto axis = Vector(0.3, -0.5, 0.8) / std::sqrt(0.98);
  for (const double angle : {0.0, 5e-324, 1e-8, 0.5, 1.0, kPi, 2 * kPi, 1e3}) {
    const auto w = Leaf(axis * angle), v = Leaf(Vector(0.4, 0.1, -0.7)), x = Leaf(Vector(-1.2, 0.6, 0.9));
    INFO(angle);
    CHECK(GradientError([&] { return ExpSe3(w, v, x); }, {w, v, x}) < 1e-6);
  }
}

TEST_CASE("at zero rotation the derivative along w is w x (x + v / 2), in float32 too") {
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    auto w = torch::zeros({3}, dtype).set_requires_grad(true);
    const auto v = Vector(0.4, 0.1, -0.7).to(dtype), x = Vector(-1.2, 0.6, 0.9).to(dtype);
    const auto direction = Vector(0.2, 0.5, -0.3).to(dtype), out = Vector(1, -2, 3).to(dtype);
    ExpSe3(w, v, x).dot(out).backward();
    const double expected = torch::linalg_cross(direction, x + 0.5 * v).dot(out).item<double>();
    CHECK(w.grad().dot(direction).item<double>() == Approx(expected).epsilon(1e-5));
  }
}

TEST_CASE("rigid motions keep distances, broadcast over points, and refuse wrong shapes") {
  const auto w = torch::randn({5, 3}, torch::kFloat64), v = torch::randn({5, 3}, torch::kFloat64);
  const auto a = torch::randn({5, 3}, torch::kFloat64), b = torch::randn({5, 3}, torch::kFloat64);
  const auto moved = (ExpSe3(w, v, a) - ExpSe3(w, v, b)).norm(2, -1);
  CHECK(moved.allclose((a - b).norm(2, -1)));
  CHECK(ExpSe3(w.unsqueeze(1), v.unsqueeze(1), a.unsqueeze(0)).sizes() == torch::IntArrayRef({5, 5, 3}));
  CHECK_THROWS_WITH(ExpSe3(torch::zeros({2}), v, a), "w: expected a last dimension of 3, found [2]");
}
