#include "libeditnerf/training/drawn_states.h"

#include <torch/torch.h>

#include "libeditnerf/training/depth_targets.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("key points are drawn one by one between visited places, and those that carry a place stay") {
  torch::manual_seed(1);
  // Key point 0 goes from 0 to 1 along x while key point 1 goes along y: a diagonal of combinations.
  torch::Tensor way = torch::zeros({5, 2, 3});
  way.select(1, 0).select(1, 0).copy_(torch::linspace(0, 1, 5));
  way.select(1, 1).select(1, 1).copy_(torch::linspace(0, 1, 5));
  way.requires_grad_(true);
  const torch::Tensor frame = torch::randint(5, {600}, torch::kInt64);
  const torch::Tensor kept = torch::cat({torch::full({200}, kStandsStill, torch::kInt64), torch::zeros({200}, torch::kInt64),
                                         torch::ones({200}, torch::kInt64)});
  const torch::Tensor drawn = DrawKeyPoints(way, frame, kept);
  REQUIRE(drawn.sizes() == torch::IntArrayRef({600, 2, 3}));
  CHECK(!drawn.requires_grad());
  const torch::Tensor seen = way.detach().index_select(0, frame);
  const auto equal = [&](int64_t from, int64_t n) {
    return (drawn.slice(0, from, from + 200).select(1, n) == seen.slice(0, from, from + 200).select(1, n)).all(1);
  };
  CHECK(equal(200, 0).all().item<bool>());
  CHECK(equal(400, 1).all().item<bool>());
  for (const auto& [from, n] : {std::pair{0, 0}, {0, 1}, {200, 1}, {400, 0}})
    CHECK(equal(from, n).to(torch::kFloat32).mean().item<double>() < 0.3);
  const torch::Tensor x = drawn.select(1, 0).select(1, 0), y = drawn.select(1, 1).select(1, 1);
  CHECK(((x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)).all().item<bool>());
  CHECK((x - y).abs().max().item<double>() > 0.6);  // far off the diagonal
}
