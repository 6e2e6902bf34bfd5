#include "libeditnerf/training/drawn_states.h"

#include <torch/torch.h>

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
