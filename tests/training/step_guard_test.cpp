#include "libeditnerf/training/step_guard.h"

#include <torch/torch.h>

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
  CHECK(verdict.losses == std::vector<double>{0.5, 2.0});
  CHECK(verdict.gradient_norm == Approx(std::sqrt(2.0) * 5));
  CHECK(guard.skipped() == 0);
}

TEST_CASE("a step that is not finite is skipped, counted and named") {
  StepGuard guard;
  const auto verdict =
      guard.Check({{"reconstruction", torch::tensor(0.5)}, {"motion", torch::tensor(kNan)}},
                  {{"codes", WithGradient(1)}, {"warp", WithGradient(std::numeric_limits<double>::infinity())}});
  CHECK_FALSE(verdict.take);
  CHECK(verdict.not_finite == "motion, gradient of warp");
  guard.Check({{"motion", torch::tensor(kNan)}}, {});
  CHECK(guard.skipped() == 2);
  CHECK(guard.failures().at("motion") == 2);
  CHECK(guard.failures().at("gradient of warp") == 1);
  CHECK(guard.failures().count("reconstruction") == 0);
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
  CHECK(guard.skipped() == 12);
}
