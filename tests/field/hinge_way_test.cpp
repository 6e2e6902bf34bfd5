#include "libeditnerf/field/hinge_way.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/geometry/se3.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr double kDegree = M_PI / 180;

// A point of a lid on a hinge that lies askew.
struct Lid {
  torch::Tensor axis = torch::tensor({0.6, 0.0, 0.8}, torch::kFloat64);
  torch::Tensor through = torch::tensor({0.2, -0.5, 1.0}, torch::kFloat64);
  torch::Tensor arm = torch::tensor({0.4, 1.0, -0.1}, torch::kFloat64);

  torch::Tensor Turns(const torch::Tensor& angle) const { return angle.unsqueeze(1) * axis; }
  torch::Tensor At(const torch::Tensor& angle) const { return through + ExpSo3(Turns(angle), arm.unsqueeze(0)); }
};

torch::Tensor Angles(double from, double to, int64_t count) {
  return torch::linspace(from * kDegree, to * kDegree, count, torch::kFloat64);
}

}  // namespace

TEST_CASE("a hinge goes on about its axis beyond both ends, as often as the clip went") {
  const Lid lid;
  const torch::Tensor angle = torch::cat({Angles(-10, 70, 20), Angles(70, 30, 20)});  // opens, and closes by half
  const HingeWay beyond = BeyondHinge(lid.At(angle), lid.Turns(angle), 0.25);
  REQUIRE(beyond.turns.size(0) == 20);
  const torch::Tensor expected = torch::cat({Angles(-12, -30, 10), Angles(72, 90, 10)});
  const auto sorted = [](const torch::Tensor& angles) { return std::get<0>(angles.sort()); };
  const torch::Tensor found = torch::matmul(beyond.turns, lid.axis);
  CHECK(torch::allclose(sorted(found), sorted(expected), 0, 1e-9));
  CHECK(torch::allclose(beyond.turns, lid.Turns(found), 0, 1e-9));
  CHECK(torch::allclose(beyond.coordinates, lid.At(found), 0, 1e-9));
}

TEST_CASE("turns and places that are a little off do not throw a hinge off its way") {
  torch::manual_seed(1);
  const Lid lid;
  const torch::Tensor angle = Angles(0, 90, 60);
  const torch::Tensor noise = 0.2 * kDegree * torch::randn({60, 3}, torch::kFloat64);
  const HingeWay beyond = BeyondHinge(lid.At(angle) + 0.003 * torch::randn_like(noise), lid.Turns(angle) + noise, 0.2);
  REQUIRE(beyond.turns.size(0) == 24);
  const torch::Tensor found = torch::matmul(beyond.turns, lid.axis);
  CHECK((beyond.coordinates - lid.At(found)).norm(2, 1).max().item<double>() < 0.01);
  CHECK((beyond.turns - lid.Turns(found)).norm(2, 1).max().item<double>() < 0.5 * kDegree);
}

TEST_CASE("what is on no hinge, hardly turns or goes all the way round has nothing beyond") {
  const Lid lid;
  const torch::Tensor angle = Angles(0, 90, 40), places = lid.At(angle), turns = lid.Turns(angle);
  const auto rows = [](const torch::Tensor& coordinates, const torch::Tensor& turned) {
    return BeyondHinge(coordinates, turned, 0.2).turns.size(0);
  };
  CHECK(rows(places, turns) == 16);
  CHECK(rows(places, torch::zeros_like(turns)) == 0);
  CHECK(rows(places + angle.unsqueeze(1) * lid.axis, turns) == 0);  // a screw
  torch::Tensor tumbling = turns.clone();
  tumbling.select(1, 1) += (3 * angle).sin();
  CHECK(rows(places, tumbling) == 0);
  CHECK(rows(lid.At(angle / 10), lid.Turns(angle / 10)) == 0);
  CHECK(rows(lid.At(4 * angle), lid.Turns(4 * angle)) == 0);
  CHECK(rows(places.slice(0, 0, 1), turns.slice(0, 0, 1)) == 0);
  CHECK(rows(places.slice(0, 0, 0), turns.slice(0, 0, 0)) == 0);
  CHECK_THROWS_AS(BeyondHinge(places, turns.slice(0, 1), 0.2), ShapeError);
}

TEST_CASE("a way round all but a few degrees is closed, not overrun") {
  const Lid lid;
  const torch::Tensor angle = Angles(0, 340, 68);
  const HingeWay beyond = BeyondHinge(lid.At(angle), lid.Turns(angle), 0.2);
  const torch::Tensor found = torch::matmul(beyond.turns, lid.axis);
  CHECK(std::abs(found.max().item<double>() - 350 * kDegree) < 1e-9);
  CHECK(std::abs(found.min().item<double>() + 10 * kDegree) < 1e-9);
}
