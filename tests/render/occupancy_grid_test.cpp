#include "libeditnerf/render/occupancy_grid.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

const Box kBox{{-1, -1, -1}, {1, 1, 1}};

OccupancyOptions SmallOptions() {
  OccupancyOptions options;
  options.resolution = 16;
  options.step = 0.02;
  options.warm_up = 4;
  return options;
}

torch::Tensor Ball(const torch::Tensor& x, double radius) { return (x.norm(2, -1) < radius).to(torch::kFloat32) * 100; }

}  // namespace

TEST_CASE("an occupancy grid starts occupied inside its box and never outside") {
  const OccupancyGrid grid(kBox, SmallOptions());
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const auto x = torch::tensor({{0.0, 0.0, 0.0},
                                {0.99, -0.99, 0.5},
                                {1.5, 0.0, 0.0},
                                {-1.001, 0.0, 0.0},
                                {0.0, 1e30, 0.0},
                                {inf, 0.0, 0.0},
                                {nan, 0.0, 0.0}},
                               torch::kFloat64);
  const auto expected = torch::tensor({true, true, false, false, false, false, false});
  CHECK(torch::equal(grid.Occupied(x), expected));
  CHECK(torch::equal(grid.Inside(x), expected));
  CHECK(grid.OccupiedShare() == 1);
}

TEST_CASE("an occupancy grid never drops occupied space and frees most of the rest") {
  torch::manual_seed(1);
  OccupancyGrid grid(kBox, SmallOptions());
  const auto x = torch::rand({20000, 3}) * 2 - 1;
  const auto inside = Ball(x, 0.4) > 0;
  for (int update = 0; update < 30; ++update) {
    grid.Update([](const torch::Tensor& points) { return Ball(points, 0.4); });
    if (update < 3) continue;  // one random point a cell may miss a cell that is barely touched
    CHECK(grid.Occupied(x).index({inside}).all().item<bool>());
  }
  // 4/3 pi 0.4^3 / 8 = 0.034 of the box; with a cell and a dilation of a cell around it, (0.4 + 0.25)^3: 0.14.
  CHECK(grid.OccupiedShare() < 0.16);
}

TEST_CASE("a part that is somewhere else at every visit keeps its swept volume occupied") {
  torch::manual_seed(2);
  OccupancyGrid grid(kBox, SmallOptions());
  const auto swept = [](const torch::Tensor& x) {
    const auto time = torch::rand({x.size(0)});
    const auto center = torch::stack({time * 1.2 - 0.6, torch::zeros_like(time), torch::zeros_like(time)}, 1);
    return Ball(x - center, 0.25);
  };
  for (int update = 0; update < 150; ++update) grid.Update(swept);
  const auto along = torch::stack({torch::linspace(-0.6, 0.6, 50), torch::zeros({50}), torch::full({50}, 0.15)}, 1);
  CHECK(grid.Occupied(along).all().item<bool>());
  CHECK(grid.OccupiedShare() < 0.3);
}

TEST_CASE("an untrained field, thin everywhere, is occupied everywhere") {
  OccupancyGrid grid(kBox, SmallOptions());
  grid.Update([](const torch::Tensor& x) { return torch::rand({x.size(0)}) * 0.01 + 0.01; });
  CHECK(grid.OccupiedShare() == 1);
  grid.Update([](const torch::Tensor& x) { return torch::zeros({x.size(0)}); });
  CHECK(grid.OccupiedShare() == 1);
}

TEST_CASE("what has gone is forgotten, and what edits need can be covered") {
  torch::manual_seed(3);
  OccupancyGrid grid(kBox, SmallOptions());
  const auto x = torch::zeros({1, 3});
  const auto corner = [](const torch::Tensor& p) { return Ball(p - 0.8, 0.3); };
  for (int update = 0; update < 4; ++update) grid.Update([](const torch::Tensor& p) { return Ball(p, 0.3); });
  CHECK(grid.Occupied(x).item<bool>());
  for (int update = 0; update < 800 && grid.Occupied(x).item<bool>(); ++update) grid.Update(corner);
  CHECK_FALSE(grid.Occupied(x).item<bool>());
  grid.Cover([](const torch::Tensor& p) { return Ball(p, 0.3); });
  CHECK(grid.Occupied(x).item<bool>());
  CHECK(grid.Occupied(x + 0.8).item<bool>());
}

TEST_CASE("the state of an occupancy grid is all in its buffers") {
  torch::manual_seed(4);
  OccupancyGrid grid(kBox, SmallOptions()), copy(kBox, SmallOptions());
  for (int update = 0; update < 3; ++update) grid.Update([](const torch::Tensor& p) { return Ball(p, 0.3); });
  for (auto& buffer : copy.named_buffers()) buffer.value().copy_(grid.named_buffers()[buffer.key()]);
  const auto x = torch::rand({1000, 3}) * 2 - 1;
  CHECK(torch::equal(copy.Occupied(x), grid.Occupied(x)));
}

TEST_CASE("an occupancy grid refuses a flat box") {
  CHECK_THROWS_WITH(OccupancyGrid({{0, 0, 0}, {1, 0, 1}}, {}),
                    "occupancy grid: expected a box with a volume, found sides 1 x 0 x 1");
}

TEST_CASE("the box around rays holds both ends of every ray") {
  const auto origin = torch::tensor({{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}}, torch::kFloat64);
  const auto direction = torch::tensor({{0.0, 0.0, 1.0}, {0.0, 1.0, 0.0}}, torch::kFloat64);
  const auto box = BoxAroundRays(origin, direction, 0.5, 2, 0.0);
  CHECK(box.low.x == 0);
  CHECK(box.high.x == 1);
  CHECK(box.high.y == 2);
  CHECK(box.high.z == 2);
  CHECK(box.low.z == 0);
}
