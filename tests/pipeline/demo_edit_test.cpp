#include "libeditnerf/pipeline/demo_edit.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// Positions on an arc of a hinge, visited out of order and more than once, with a little noise; [T, 3].
torch::Tensor ArcTrack(int64_t count) {
  const auto angle = 0.9 * (torch::arange(count, torch::kFloat64) * 1.7).sin();
  const auto wobble = 0.01 * (torch::arange(count, torch::kFloat64) * 5.3).cos();
  return torch::stack({angle.sin(), angle.cos() + wobble, 0.2 * angle}, 1);
}

double LargestStep(const torch::Tensor& way) {
  return (way.slice(0, 1) - way.slice(0, 0, -1)).norm(2, 1).max().item<double>();
}

}  // namespace

TEST_CASE("a sweep stays in the convex range of the visited positions") {
  const auto track = ArcTrack(40);
  const auto rest = track[20];
  for (const double phase : {0.0, 0.5}) {
    const auto way = SweepAlong(track, rest, 48, phase);
    REQUIRE(way.sizes() == torch::IntArrayRef({48, 3}));
    // In many directions: never beyond the farthest visited position.
    torch::manual_seed(1);
    const auto directions = torch::randn({3, 200}, torch::kFloat64);
    const auto reach = std::get<0>(track.matmul(directions).max(0));
    CHECK((way.matmul(directions) <= reach + 1e-12).all().item<bool>());
  }
}

TEST_CASE("a sweep starts and ends at rest, moves smoothly and reaches both extremes") {
  const auto track = ArcTrack(60);
  const auto way = SweepAlong(track, track[30], 96);
  CHECK((way[0] - track[30]).norm().item<double>() < 1e-12);
  CHECK((way[-1] - track[30]).norm().item<double>() < 1e-12);
  const auto range = [](const torch::Tensor& points) {
    const auto x = points.select(1, 0);
    return (x.max() - x.min()).item<double>();
  };
  CHECK(range(way) > 0.9 * range(track));
  CHECK(LargestStep(way) < 0.15 * range(track));
}

TEST_CASE("the same track gives the same sweep, whatever its type") {
  const auto track = ArcTrack(25).to(torch::kFloat32);
  const auto way = SweepAlong(track, track[3], 30);
  CHECK(torch::equal(way, SweepAlong(track.clone(), track[3].clone(), 30)));
  CHECK((way - SweepAlong(track.to(torch::kFloat64), track[3].to(torch::kFloat64), 30)).abs().max().item<double>() ==
        0);
}

TEST_CASE("two positions make a sweep between them") {
  const auto track = torch::tensor({0.0, 0.0, 0.0, 1.0, 2.0, 3.0}, torch::kFloat64).view({2, 3});
  const auto way = SweepAlong(track, track[0], 41);
  CHECK((way[20] - track[1]).norm().item<double>() < 1e-9);
  CHECK((way[40] - track[0]).norm().item<double>() < 1e-9);
}

TEST_CASE("a key point that never moved stays where it is") {
  const auto track = torch::tensor({0.3, -0.2, 1.0}, torch::kFloat64).expand({10, 3});
  for (const int64_t count : {int64_t{1}, int64_t{2}, int64_t{17}}) {
    const auto way = SweepAlong(track, track[0], count);
    REQUIRE(way.size(0) == count);
    CHECK((way - track[0]).abs().max().item<double>() < 1e-12);
  }
  CHECK(SweepAlong(track.slice(0, 0, 1), track[0], 5).isfinite().all().item<bool>());
}

TEST_CASE("a sweep without positions or steps is refused") {
  CHECK_THROWS_AS(SweepAlong(torch::zeros({0, 3}), torch::zeros({3}), 5), ShapeError);
  CHECK_THROWS_AS(SweepAlong(torch::zeros({4, 2}), torch::zeros({3}), 5), ShapeError);
  CHECK_THROWS_WITH(SweepAlong(torch::zeros({4, 3}), torch::zeros({3}), 0),
                    "sweep: expected at least one position and one step, found 4 and 0");
}
