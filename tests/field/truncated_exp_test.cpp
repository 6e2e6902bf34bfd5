#include "libeditnerf/field/truncated_exp.h"

#include <torch/types.h>

#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("the truncated exponential is exp where it matters and bounded elsewhere") {
  auto x = torch::tensor({-1e4, -15.0, 0.0, 1.5, 15.0, 1e4}, torch::kFloat64).requires_grad_();
  const auto y = TruncatedExp(x);
  CHECK(torch::allclose(y.slice(0, 1, 5), x.slice(0, 1, 5).exp()));
  y.sum().backward();
  CHECK(x.grad().isfinite().all().item<bool>());
  CHECK((x.grad() > 0).all().item<bool>());
  CHECK(y.max().item<double>() == Approx(std::exp(15.0)));
}
