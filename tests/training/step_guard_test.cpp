#include "libeditnerf/training/step_guard.h"

#include <torch/types.h>

#include <limits>

#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

torch::Tensor WithGradient(double gradient) {
  auto parameter = torch::zeros({2}).requires_grad_(true);
  (parameter.sum() * gradient).backward();
  return parameter;
}

}  // namespace

TEST_CASE("a finite step is taken, with its values for the log") {
  StepGuard guard;
  const auto verdict = guard.Check({{"reconstruction", torch::tensor(0.5)}, {"motion", torch::tensor({2.0})}},
                                   {{"a", WithGradient(3)}, {"b", WithGradient(4)}, {"unused", torch::zeros({3})}});
  CHECK(verdict.take);
  CHECK_FALSE(verdict.roll_back);
  CHECK(verdict.not_finite.empty());
  CHECK(verdict.losses == NamedValues{{"reconstruction", 0.5}, {"motion", 2.0}});
  REQUIRE(verdict.gradients.size() == 2);
  CHECK(verdict.gradients[1].first == "b");
  CHECK(verdict.gradients[1].second == Approx(std::sqrt(2.0) * 4));
  CHECK(verdict.gradient_norm == Approx(std::sqrt(2.0) * 5));
  CHECK(guard.failures_in_a_row() == 0);
}

TEST_CASE("a step that is not finite is not taken, and what is not finite is named") {
  StepGuard guard;
  const auto verdict =
      guard.Check({{"reconstruction", torch::tensor(0.5)}, {"motion", torch::tensor(kNan)}},
                  {{"codes", WithGradient(1)}, {"warp", WithGradient(std::numeric_limits<double>::infinity())}});
  CHECK_FALSE(verdict.take);
  CHECK(verdict.not_finite == std::vector<std::string>{"motion", "gradient of warp"});
  CHECK(guard.failures_in_a_row() == 1);
}

TEST_CASE("a gradient that Adam cannot square is not finite") {
  StepGuard guard;
  CHECK(guard.Check({}, {{"a", WithGradient(1e18)}}).take);
  CHECK_FALSE(guard.Check({}, {{"a", WithGradient(2e19)}}).take);
}

TEST_CASE("long lists of names are cut short") {
  CHECK(ListOf({}) == "");
  CHECK(ListOf({"a", "b"}, 2) == "a, b");
  CHECK(ListOf({"a", "b", "c", "d"}, 2) == "a, b and 2 more");
}

TEST_CASE("only failures in a row ask for a roll back") {
  StepGuard guard(3);
  const NamedTensors bad = {{"motion", torch::tensor(kNan)}}, good = {{"motion", torch::tensor(1.0)}};
  for (int round = 0; round < 3; ++round) {
    CHECK_FALSE(guard.Check(bad, {}).roll_back);
    CHECK_FALSE(guard.Check(bad, {}).roll_back);
    CHECK(guard.Check(good, {}).take);
  }
  for (int round = 0; round < 2; ++round) {
    CHECK_FALSE(guard.Check(bad, {}).roll_back);
    CHECK_FALSE(guard.Check(bad, {}).roll_back);
    CHECK(guard.Check(bad, {}).roll_back);
  }
}
