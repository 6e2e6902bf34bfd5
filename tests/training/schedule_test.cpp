#include "libeditnerf/training/schedule.h"

#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("the learning rate falls exponentially from its initial to its final value and stays there") {
  CHECK(ExponentialSchedule(1e-3, 1e-4, 0) == Approx(1e-3));
  CHECK(ExponentialSchedule(1e-3, 1e-5, 0.5) == Approx(1e-4));
  CHECK(ExponentialSchedule(1e-3, 1e-4, 1) == Approx(1e-4));
  CHECK(ExponentialSchedule(1e-3, 1e-4, 7) == Approx(1e-4));
}

TEST_CASE("a stage is as far as the nearer of its two ends") {
  StageConfig config;
  config.steps = 1000;
  CHECK(StageProgress(config, 250, 1e9) == 0.25);
  config.seconds = 100;
  CHECK(StageProgress(config, 250, 10) == 0.25);
  CHECK(StageProgress(config, 250, 50) == 0.5);
  CHECK(StageProgress(config, 5000, 0) == 1);
}

TEST_CASE("a ramp waits, rises and stays") {
  CHECK(LinearRamp(0, 10, 20) == 0);
  CHECK(LinearRamp(10, 10, 20) == 0);
  CHECK(LinearRamp(20, 10, 20) == 0.5);
  CHECK(LinearRamp(30, 10, 20) == 1);
  CHECK(LinearRamp(9, 10, 0) == 0);
  CHECK(LinearRamp(10, 10, 0) == 1);
}
