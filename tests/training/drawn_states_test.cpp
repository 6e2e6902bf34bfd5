#include "libeditnerf/training/drawn_states.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/training/depth_targets.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("key points are drawn one by one between visited places, and those that carry a ray at visited ones") {
  torch::manual_seed(1);
  // Key point 0 goes from 0 to 1 along x while key point 1 goes along y: a diagonal of combinations.
  torch::Tensor way = torch::zeros({5, 2, 3});
  way.select(1, 0).select(1, 0).copy_(torch::linspace(0, 1, 5));
  way.select(1, 1).select(1, 1).copy_(torch::linspace(0, 1, 5));
  way.requires_grad_(true);
  const torch::Tensor carrier = torch::tensor({kStandsStill, int64_t{0}, int64_t{1}}).repeat_interleave(200);
  const torch::Tensor drawn = DrawKeyPoints(way, carrier, false);
  REQUIRE(drawn.sizes() == torch::IntArrayRef({600, 2, 3}));
  CHECK(!drawn.requires_grad());
  const auto visited = [&](int64_t from, int64_t n) {
    const torch::Tensor four = 4 * drawn.slice(0, from, from + 200).select(1, n).select(1, n);
    return (four == four.round()).to(torch::kFloat32).mean().item<double>();
  };
  CHECK(visited(200, 0) == 1);
  CHECK(visited(400, 1) == 1);
  for (const auto& [from, n] : {std::pair{0, 0}, {0, 1}, {200, 1}, {400, 0}}) CHECK(visited(from, n) < 0.4);
  const torch::Tensor x = drawn.select(1, 0).select(1, 0), y = drawn.select(1, 1).select(1, 1);
  CHECK(((x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)).all().item<bool>());
  CHECK((x - y).abs().max().item<double>() > 0.6);  // far off the diagonal
}

TEST_CASE("along the way key points are drawn between a frame and the next, each at a time of its own") {
  torch::manual_seed(2);
  // A quarter of a circle, in four chords.
  const torch::Tensor angle = torch::linspace(0, M_PI / 2, 5).view({5, 1});
  const torch::Tensor way = torch::stack({angle.cos(), angle.sin(), torch::zeros_like(angle)}, 2).repeat({1, 2, 1});
  const torch::Tensor drawn = DrawKeyPoints(way, torch::full({300}, kStandsStill, torch::kInt64), true);
  const torch::Tensor radius = drawn.norm(2, 2);
  CHECK(radius.min().item<double>() > std::cos(M_PI / 16) - 1e-4);  // no chord but those
  CHECK(radius.max().item<double>() < 1 + 1e-6);
  CHECK(radius.std().item<double>() > 1e-3);  // between frames, too
  CHECK((drawn.select(1, 0) - drawn.select(1, 1)).norm(2, 1).max().item<double>() > 0.9);
}

TEST_CASE("no part is put where a place stands, and one that cannot be elsewhere stays where it was") {
  torch::manual_seed(3);
  torch::Tensor way = torch::zeros({11, 2, 3});
  way.select(1, 0).select(1, 0).copy_(torch::linspace(0, 1, 11));  // goes along x; key point 1 rests at the origin
  const int64_t count = 400;
  ClearPlaces places;
  places.place = torch::tensor({0.6F, 0.0F, 0.0F}).expand({count, 3});
  places.frame = torch::zeros({count}, torch::kInt64);
  places.carrier = torch::full({count}, kOtherLight, torch::kInt64);
  places.reach = torch::tensor({0.2F, 0.7F});
  const torch::Tensor drawn = DrawKeyPointsClearOf(places, way, false);
  const torch::Tensor x = drawn.select(1, 0).select(1, 0);
  CHECK(((x - 0.6).abs() > 0.2).all().item<bool>());
  CHECK(x.max().item<double>() > 0.8);
  CHECK(std::get<0>(torch::unique_dim(x, 0)).numel() > count / 2);
  CHECK(drawn.select(1, 1).abs().max().item<double>() == 0);  // everywhere within reach: as in its frame
  places.carrier.fill_(0);                                    // carried places go along with their part
  CHECK(((DrawKeyPointsClearOf(places, way, false).select(1, 0).select(1, 0) - 0.6).abs() < 0.15).any().item<bool>());
}

TEST_CASE("a part reaches a little farther than its places") {
  torch::Tensor way = torch::zeros({2, 2, 3});
  way[1][0][0] = 5;
  const torch::Tensor places = torch::tensor({1.0F, 0.0F, 0.0F, 5.0F, 1.0F, 0.0F, 9.0F, 9.0F, 9.0F}).view({3, 3});
  const torch::Tensor reach = PartReach(places, torch::tensor({0, 1, 0}, torch::kInt64),
                                        torch::tensor({int64_t{0}, int64_t{0}, kStandsStill}), way);
  CHECK(reach[0].item<double>() == Approx(1.15));
  CHECK(reach[1].item<double>() == 0);
  CHECK(!PartReach(places, torch::zeros({3}, torch::kInt64), torch::full({3}, kStandsStill, torch::kInt64), way)
             .defined());
}

TEST_CASE("drawn states have the light of their frame where nothing carries the place, and their own elsewhere") {
  FrameStates states;
  states.key_points = torch::rand({4, 2, 3});
  const torch::Tensor drawn = torch::rand({2, 2, 3}), frame = torch::tensor({3, 1}, torch::kInt64);
  const FrameStates all = WithDrawn(states, drawn, frame, torch::tensor({kOtherLight, int64_t{1}}));
  CHECK(torch::equal(all.key_points, torch::cat({states.key_points, drawn})));
  REQUIRE(all.casters.sizes() == all.key_points.sizes());
  CHECK(torch::equal(all.casters.slice(0, 0, 4), states.key_points));
  CHECK(torch::equal(all.casters[4], states.key_points[3]));
  CHECK(torch::equal(all.casters[5], drawn[1]));
  CHECK(!WithDrawn(states, drawn, frame, {}).casters.defined());  // a field without shade
}
