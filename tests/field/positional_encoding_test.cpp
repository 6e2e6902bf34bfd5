#include "libeditnerf/field/positional_encoding.h"

#include <torch/autograd.h>
#include <torch/types.h>

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

const double kPi = std::acos(-1.0);

double Window(double alpha, int64_t k) {
  return 0.5 * (1 - std::cos(kPi * std::min(1.0, std::max(0.0, alpha - static_cast<double>(k)))));
}

}  // namespace

TEST_CASE("the encoding of zero with one octave is (0, 0, 1)") {
  const auto encoded = PositionalEncoding(1, 1).forward(torch::zeros({1}, torch::kFloat64));
  CHECK(encoded.equal(torch::tensor({0.0, 0.0, 1.0}, torch::kFloat64)));
}

TEST_CASE("the encoding holds identity, sines and cosines of doubling frequencies, weighted by the window") {
  const int64_t octaves = 5;
  const PositionalEncoding encoding(3, octaves);
  REQUIRE(encoding.output_dim() == 33);
  const auto x = torch::randn({4, 3}, torch::kFloat64) * 3;
  for (const double alpha : {-1.0, 0.0, 0.3, 2.5, 5.0, 9.0}) {
    const auto encoded = encoding.forward(x, alpha);
    REQUIRE(encoded.sizes() == torch::IntArrayRef({4, 33}));
    double worst = 0;
    for (int64_t s = 0; s < 4; ++s) {
      for (int64_t d = 0; d < 3; ++d) {
        const double value = x[s][d].item<double>();
        worst = std::max(worst, std::abs(encoded[s][d].item<double>() - value));
        for (int64_t k = 0; k < octaves; ++k) {
          const double phase = value * std::pow(2.0, k), w = Window(alpha, k);
          worst = std::max(worst, std::abs(encoded[s][3 + 6 * k + d].item<double>() - w * std::sin(phase)));
          worst = std::max(worst, std::abs(encoded[s][6 + 6 * k + d].item<double>() - w * std::cos(phase)));
        }
      }
    }
    CHECK(worst < 1e-12);
  }
  CHECK(encoding.forward(x).equal(encoding.forward(x, 5.0)));
}

TEST_CASE("the float32 kernel of the encoding agrees with double precision in value and gradient") {
  for (const bool identity : {true, false}) {
    for (const int64_t count : {1, 85, 86, 3000}) {
      const PositionalEncoding encoding(3, 8, identity);
      const auto fine = ((torch::rand({count, 3}) * 2 - 1) * 3.1).to(torch::kFloat64).set_requires_grad(true);
      const auto fast = fine.detach().to(torch::kFloat32).set_requires_grad(true);
      const auto expected = encoding.forward(fine, 5.3), found = encoding.forward(fast, 5.3);
      REQUIRE(found.sizes() == expected.sizes());
      CHECK((found - expected).abs().max().item<double>() < 1e-6);
      const auto upstream = torch::randn(expected.sizes(), torch::kFloat64);
      const auto expected_grad = torch::autograd::grad({(expected * upstream).sum()}, {fine})[0];
      const auto found_grad = torch::autograd::grad({(found * upstream).sum()}, {fast})[0];
      CHECK((found_grad - expected_grad).norm().item<double>() < 1e-5 * expected_grad.norm().item<double>());
    }
  }
}

TEST_CASE("without identity only the waves are left, and without octaves only the identity") {
  const auto x = torch::randn({2, 5, 3}, torch::kFloat64);
  CHECK(PositionalEncoding(3, 0).forward(x).equal(x));
  const PositionalEncoding waves(3, 1, false);
  CHECK(waves.output_dim() == 6);
  CHECK(waves.forward(x).allclose(torch::cat({x.sin(), x.cos()}, -1)));
  CHECK(waves.forward(x, 0.0).abs().max().item<double>() == 0);
}

TEST_CASE("the encoding has the gradients of its formula, near and far") {
  const PositionalEncoding encoding(2, 4);
  for (const double scale : {0.5, 50.0}) {
    const auto x = Leaf(torch::randn({5, 2}, torch::kFloat64) * scale);
    CHECK(GradientError([&] { return encoding.forward(x, 2.7); }, {x}) < 1e-6);
  }
}

TEST_CASE("every finite input has a finite encoding and gradient") {
  const PositionalEncoding encoding(1, 20);
  const auto largest = static_cast<double>(std::numeric_limits<float>::max());
  auto x = torch::tensor({1e4, -1e9, 1e30, -3e38, largest, -largest}).unsqueeze(-1).set_requires_grad(true);
  const auto encoded = encoding.forward(x);
  CHECK(encoded.isfinite().all().item<bool>());
  CHECK(encoded.narrow(-1, 1, 40).abs().max().item<double>() <= 1);
  encoded.sum().backward();
  CHECK(x.grad().isfinite().all().item<bool>());
  const auto wide = torch::full({1, 1}, std::numeric_limits<double>::max(), torch::kFloat64);
  CHECK(encoding.forward(wide).isfinite().all().item<bool>());
}

TEST_CASE("the window opens linearly after its delay") {
  CHECK(WindowAlpha(0, 0, 80000, 7) == 0);
  CHECK(WindowAlpha(40000, 0, 80000, 7) == 3.5);
  CHECK(WindowAlpha(200000, 0, 80000, 7) == 7);
  CHECK(WindowAlpha(999, 1000, 10000, 1) == 0);
  CHECK(WindowAlpha(6000, 1000, 10000, 1) == 0.5);
  CHECK(WindowAlpha(0, 0, 0, 4) == 4);
  CHECK(WindowAlpha(9, 10, 0, 4) == 0);
  CHECK(WindowAlpha(10, 10, 0, 4) == 4);
}

TEST_CASE("the encoding refuses wrong sizes") {
  CHECK_THROWS_WITH(PositionalEncoding(3, 2).forward(torch::zeros({4, 2})),
                    "x: expected a last dimension of 3, found [4, 2]");
  CHECK_THROWS_WITH(PositionalEncoding(3, 0, false),
                    "positional encoding: expected an octave or the identity, found neither");
  CHECK_THROWS_WITH(PositionalEncoding(3, -1), "positional encoding: num_octaves: expected 0 or more, found -1");
  CHECK_THROWS_AS(PositionalEncoding(0, 1), ConfigError);
}
