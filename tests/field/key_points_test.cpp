#include "libeditnerf/field/key_points.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

// With linear interpolation between the order statistics.
double Percentile(std::vector<double> values, double fraction) {
  std::sort(values.begin(), values.end());
  const double position = fraction * static_cast<double>(values.size() - 1);
  const size_t low = static_cast<size_t>(position);
  const size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (position - static_cast<double>(low)) * (values[high] - values[low]);
}

struct Warnings {
  std::vector<std::string> texts;
  Warnings() {
    SetLogLevel(LogLevel::kWarning);
    SetLogSink([this](LogLevel, const std::string& text) { texts.push_back(text); });
  }
  ~Warnings() {
    SetLogSink({});
    SetLogLevel(LogLevel::kError);
  }
};

}  // namespace

TEST_CASE("local coordinates are scaled by the widest percentile range and centred") {
  const auto tracks = torch::randn({17, 2, 3}, torch::kFloat64) * torch::tensor({0.3, 1.0, 0.1}, torch::kFloat64);
  KeyPointTable table(tracks);
  for (int64_t n = 0; n < 2; ++n) {
    double range = 0;
    for (int64_t axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (int64_t t = 0; t < 17; ++t) values.push_back(tracks[t][n][axis].item<double>());
      range = std::max(range, Percentile(values, 0.9) - Percentile(values, 0.1));
    }
    CHECK(table->scale[n].item<double>() == Approx(1 / range).epsilon(1e-12));
    for (int64_t axis = 0; axis < 3; ++axis) {
      double mean = 0;
      for (int64_t t = 0; t < 17; ++t) mean += tracks[t][n][axis].item<double>() / range / 17;
      CHECK(table->offset[n][axis].item<double>() == Approx(-mean).epsilon(1e-12).margin(1e-12));
      CHECK(table->local[3][n][axis].item<double>() ==
            Approx(tracks[3][n][axis].item<double>() / range - mean).epsilon(1e-12).margin(1e-12));
    }
  }
}

TEST_CASE("positions return the initial tracks, and local and scene coordinates invert each other") {
  const auto tracks = torch::randn({9, 3, 3}, torch::kFloat64);
  KeyPointTable table(tracks);
  const auto time = torch::tensor({8, 0, 8, 3}, torch::kInt64);
  CHECK(table->Positions(time).allclose(tracks.index_select(0, time)));
  const auto points = torch::randn({2, 5, 3, 3}, torch::kFloat64);
  CHECK(table->FromLocal(table->ToLocal(points)).allclose(points));
  CHECK(GradientError([&] { return table->Positions(time); }, {table->local}) < 1e-8);
}

TEST_CASE("a key point that does not move gets a floor on its range and a warning with its number") {
  auto tracks = torch::rand({12, 2, 3}, torch::kFloat64);
  tracks.select(1, 1).copy_(torch::tensor({0.2, -0.1, 0.4}, torch::kFloat64).expand({12, 3}));
  const Warnings warnings;
  KeyPointTable table(tracks);
  CHECK(table->scale[1].item<double>() == Approx(1 / kSmallestTrackRange));
  CHECK(table->local.isfinite().all().item<bool>());
  CHECK(table->Positions(torch::arange(12, torch::kInt64)).allclose(tracks));
  REQUIRE(warnings.texts.size() == 1);
  CHECK(warnings.texts[0] ==
        "key point 1: its initial track moves by 0 scene units only; its local coordinates are scaled as for 0.01");
}

TEST_CASE("a single frame is a track that does not move") {
  const Warnings warnings;
  KeyPointTable table(torch::rand({1, 1, 3}));
  CHECK(table->local.abs().max().item<double>() < 1e-5);
  CHECK(warnings.texts.size() == 1);
}

TEST_CASE("the weighted key point is the weighted sum of the state's key points") {
  const auto points = torch::randn({3, 4, 3}, torch::kFloat64);
  const auto weights = torch::softmax(torch::randn({6, 4}, torch::kFloat64), -1);
  const auto state = torch::tensor({0, 2, 1, 2, 0, 0}, torch::kInt64);
  const auto found = WeightedKeyPoint(weights, points, state);
  for (int64_t s = 0; s < 6; ++s) {
    for (int64_t axis = 0; axis < 3; ++axis) {
      double sum = 0;
      for (int64_t n = 0; n < 4; ++n) {
        sum += weights[s][n].item<double>() * points[state[s].item<int64_t>()][n][axis].item<double>();
      }
      CHECK(found[s][axis].item<double>() == Approx(sum).margin(1e-12));
    }
  }
  const auto w = Leaf(weights), k = Leaf(points);
  CHECK(GradientError([&] { return WeightedKeyPoint(w, k, state); }, {w, k}) < 1e-8);
}

TEST_CASE("one key point needs no weights") {
  const auto points = torch::randn({3, 1, 3});
  const auto found = WeightedKeyPoint({}, points, torch::tensor({2, 0}, torch::kInt64));
  CHECK(found[0].equal(points[2][0]));
  CHECK_THROWS_WITH(WeightedKeyPoint({}, torch::zeros({3, 2, 3}), torch::tensor({2, 0}, torch::kInt64)),
                    "key_points without weights: expected shape [*, 1, 3], found [3, 2, 3]");
}

TEST_CASE("key points refuse tracks with holes and wrong shapes") {
  auto tracks = torch::rand({5, 2, 3});
  tracks[3][1][0] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH(KeyPointTable(tracks),
                    "initial tracks: key point 1 is not finite in frame 3; expected a position in every frame");
  CHECK_THROWS_WITH(KeyPointTable(torch::zeros({5, 3})), "tracks: expected shape [*, *, 3], found [5, 3]");
  KeyPointTable table(torch::rand({5, 2, 3}));
  CHECK_THROWS_WITH(table->ToLocal(torch::zeros({4, 3, 3})),
                    "key_points' axis before the last: expected a last dimension of 2, found [4, 3]");
  CHECK_THROWS_WITH(WeightedKeyPoint(torch::zeros({2, 3}), torch::zeros({5, 2, 3}), torch::zeros({2}, torch::kInt64)),
                    "weights: expected shape [2, 2], found [2, 3]");
}
