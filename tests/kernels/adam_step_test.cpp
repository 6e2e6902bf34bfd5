#include "libeditnerf/kernels/adam_step.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>

#include "tests/catch.h"
#include "tests/kernels/each_target.h"

using namespace editnerf;

namespace {

constexpr AdamUpdate kUpdate = {0.9F, 0.99F, 0.02F, 3.0F, 1e-8F};

struct Parameter {
  torch::Tensor gradient, value, first, second;
};

Parameter RandomParameter(int64_t count) {
  Parameter p = {torch::randn({count}), torch::randn({count}), torch::randn({count}), torch::rand({count})};
  p.gradient.masked_fill_(torch::rand({count}) < 0.5, 0.0);
  return p;
}

Parameter Expected(const Parameter& p, bool sparse) {
  const auto first = p.first * kUpdate.beta1 + p.gradient * (1 - kUpdate.beta1);
  const auto second = p.second * kUpdate.beta2 + p.gradient.square() * (1 - kUpdate.beta2);
  const auto value = p.value - kUpdate.rate * first / (second.sqrt() * kUpdate.scale + kUpdate.epsilon);
  if (!sparse) return {p.gradient, value, first, second};
  const auto touched = p.gradient != 0;
  return {torch::zeros_like(p.gradient), torch::where(touched, value, p.value), torch::where(touched, first, p.first),
          torch::where(touched, second, p.second)};
}

}  // namespace

TEST_CASE("Adam's kernels take the steps of the formula, for any size") {
  torch::manual_seed(1);
  ForEachTarget([] {
    for (const int64_t count : {0, 1, 7, 16, 65, 5000}) {
      for (const bool sparse : {false, true}) {
        Parameter p = RandomParameter(count);
        const Parameter expected = Expected(p, sparse);
        float *const g = p.gradient.data_ptr<float>(), *const x = p.value.data_ptr<float>();
        float *const first = p.first.data_ptr<float>(), *const second = p.second.data_ptr<float>();
        if (sparse) {
          SparseAdamStep(kUpdate, count, g, x, first, second);
        } else {
          AdamStep(kUpdate, count, g, x, first, second);
        }
        CHECK(torch::allclose(p.value, expected.value, 1e-5, 1e-6));
        CHECK(torch::allclose(p.first, expected.first, 1e-5, 1e-6));
        CHECK(torch::allclose(p.second, expected.second, 1e-5, 1e-6));
        CHECK(torch::equal(p.gradient, expected.gradient));
      }
    }
  });
}

TEST_CASE("sums of squares are right and tell a NaN") {
  torch::manual_seed(2);
  ForEachTarget([] {
    for (const int64_t count : {0, 1, 17, 10000}) {
      const auto x = torch::randn({count});
      CHECK(SumOfSquares(x.data_ptr<float>(), count) == Approx(x.square().sum().item<double>()).epsilon(1e-5));
    }
    const auto x = torch::ones({100});
    x[63] = std::numeric_limits<float>::quiet_NaN();
    CHECK(std::isnan(SumOfSquares(x.data_ptr<float>(), 100)));
  });
}
