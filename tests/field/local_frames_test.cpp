#include "libeditnerf/field/local_frames.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/geometry/se3.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// A lid's corner on its way about the y axis, 0 to 100 degrees, and a second point that slides without turning.
struct Way {
  torch::Tensor angle = torch::linspace(0, 100 * M_PI / 180, 50);  // [T]
  torch::Tensor points = torch::stack({Corner(angle), Slide(angle)}, 1);
  torch::Tensor turns = torch::zeros({50, 2, 3});

  Way() { turns.select(1, 0).select(1, 1).copy_(angle); }
  static torch::Tensor Corner(const torch::Tensor& a) {
    return torch::stack({a.cos(), 0.3 * torch::ones_like(a), -a.sin()}, 1);
  }
  static torch::Tensor Slide(const torch::Tensor& a) { return torch::stack({a - 1, torch::zeros_like(a), 0.2 * a}, 1); }
};

}  // namespace

TEST_CASE("known turns are followed between the frames and those of a hinge beyond them, by rotations") {
  torch::manual_seed(1);
  const Way way;
  LocalFrames frames(way.points, way.turns);
  const torch::NoGradGuard no_grad;
  const auto worst = [&](double from, double to, int64_t points = 2) {
    const torch::Tensor angle = torch::linspace(from * M_PI / 180, to * M_PI / 180, 33);
    const torch::Tensor found = frames->RotationVectors(torch::stack({Way::Corner(angle), Way::Slide(angle)}, 1));
    torch::Tensor expected = torch::zeros_like(found);
    expected.select(1, 0).select(1, 1).copy_(angle);
    return (found - expected).norm(2, -1).slice(1, 0, points).max().item<double>() * 180 / M_PI;
  };
  CHECK(worst(0, 100) < 0.3);
  CHECK(worst(100, 108) < 6);
  CHECK(worst(-18, 118, 1) < 0.3);
  const torch::Tensor r = frames->forward(way.points);
  CHECK(torch::allclose(torch::matmul(r, r.transpose(2, 3)), torch::eye(3).expand_as(r), 0, 1e-5));
  // In its own frame a point of the lid stands still: one that lies half-way from the hinge to the corner.
  const torch::Tensor half = torch::stack({0.5 * way.angle.cos(), torch::zeros({50}), -0.5 * way.angle.sin()}, 1);
  const torch::Tensor own =
      InLocalFrames(half, torch::tensor({1.0F, 0.0F}).expand({50, 2}), way.points, r, torch::arange(50, torch::kInt64));
  CHECK((own - own[0]).norm(2, 1).max().item<double>() < 0.005);
}

TEST_CASE("local frames turn x - k by the samples' own states and weights") {
  torch::manual_seed(2);
  const torch::Tensor x = torch::rand({7, 3}), keys = torch::rand({4, 3, 3}),
                      state = torch::randint(4, {7}, torch::kInt64);
  const torch::Tensor turns = 2 * torch::rand({4, 3, 3}) - 1;
  const torch::Tensor weights = torch::softmax(torch::rand({7, 3}), 1);
  const torch::Tensor frames = ExpSo3(turns.unsqueeze(2), torch::eye(3).view({1, 1, 3, 3}));  // exp([r]) transposed
  const torch::Tensor found = InLocalFrames(x, weights, keys, frames, state);
  for (int64_t s = 0; s < 7; ++s) {
    torch::Tensor sum = torch::zeros({3});
    for (int64_t i = 0; i < 3; ++i)
      sum += weights[s][i] * ExpSo3(-turns[state[s].item<int64_t>()][i], x[s] - keys[state[s].item<int64_t>()][i]);
    CHECK(torch::allclose(found[s], sum, 1e-5, 1e-6));
  }
  CHECK(torch::allclose(InLocalFrames(x, {}, keys.slice(1, 0, 1), torch::eye(3).expand({4, 1, 3, 3}), state),
                        x - keys.select(1, 0).index_select(0, state)));
  CHECK_THROWS_AS(InLocalFrames(x, {}, keys, torch::zeros({4, 3, 3}), state), ShapeError);
}

TEST_CASE("local frames are differentiable at no turn at all, and refuse what is not finite") {
  LocalFrames still(3);
  const torch::Tensor at = torch::rand({5, 3, 3}).requires_grad_(true);
  const torch::Tensor r = still->forward(at);
  CHECK(torch::allclose(r, torch::eye(3).expand({5, 3, 3, 3})));
  (r * torch::rand_like(r)).sum().backward();
  CHECK(at.grad().isfinite().all().item<bool>());
  for (const torch::Tensor& parameter : still->parameters()) CHECK(parameter.grad().isfinite().all().item<bool>());
  torch::Tensor turns = torch::zeros({5, 3, 3});
  turns[2][1][0] = NAN;
  CHECK_THROWS_AS(LocalFrames(at.detach(), turns), DataError);
  CHECK_THROWS_AS(LocalFrames(at.detach(), turns.slice(0, 1)), ShapeError);
}

TEST_CASE("turns are unwrapped past half and whole turns, about any axis") {
  const torch::Tensor axis = torch::tensor({0.6, 0.0, -0.8}, torch::kFloat64);
  const torch::Tensor angle = torch::linspace(0, 9, 60, torch::kFloat64);
  const torch::Tensor whole = (angle.unsqueeze(1) * axis).unsqueeze(1);  // [T, 1, 3]
  const torch::Tensor wrapped = (torch::remainder(angle + M_PI, 2 * M_PI) - M_PI).unsqueeze(1).unsqueeze(2) * axis;
  CHECK(torch::allclose(UnwrapTurns(wrapped), whole, 1e-6, 1e-6));
  CHECK(torch::equal(UnwrapTurns(torch::zeros({4, 2, 3})), torch::zeros({4, 2, 3}, torch::kFloat64)));
}
