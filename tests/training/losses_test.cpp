#include "libeditnerf/training/losses.h"

#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/geometry/camera.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Three cameras in a row that look along z.
std::vector<Camera> ThreeCameras() {
  std::vector<Camera> cameras(3);
  for (int i = 0; i < 3; ++i) {
    cameras[i].position = {0.05 * i, 0.02 * i, -1};
    cameras[i].focal_length = 24;
    cameras[i].width = 24;
    cameras[i].height = 16;
    cameras[i].principal_point = {12, 8};
  }
  return cameras;
}

CameraTensors Stacked() { return StackCameras(ThreeCameras(), torch::kFloat64); }

// Two pairs of two key points in the middle of the pictures, between pixel centres.
FramePairs SomePairs() {
  torch::manual_seed(7);
  FramePairs pairs;
  pairs.frame = torch::tensor({0, 1}, torch::kInt64);
  pairs.key_points = torch::rand({2, 2, 3}, torch::kFloat64) * 0.4 - 0.2;
  pairs.key_points_next = pairs.key_points + torch::rand({2, 2, 3}, torch::kFloat64) * 0.1;
  return pairs;
}

Vec3 PointOf(const torch::Tensor& points, int64_t pair, int64_t i) {
  const auto p = points[pair][i];
  return {p[0].item<double>(), p[1].item<double>(), p[2].item<double>()};
}

}  // namespace

TEST_CASE("the reconstruction loss adds the fine and the coarse mean squared error") {
  const auto target = torch::zeros({2, 3}), rgb = torch::full({2, 3}, 0.5), coarse = torch::full({2, 3}, 0.25);
  CHECK(ReconstructionLoss(rgb, {}, target).item<float>() == 0.25f);
  CHECK(ReconstructionLoss(rgb, coarse, target).item<float>() == 0.3125f);
  CHECK_THROWS_AS(ReconstructionLoss(rgb, {}, torch::zeros({3, 3})), ShapeError);
  const auto emphasis = torch::tensor({2.0F, 0.5F});
  CHECK(ReconstructionLoss(rgb, {}, target, emphasis).item<float>() == 0.3125f);
  CHECK_THROWS_AS(ReconstructionLoss(rgb, {}, target, torch::ones({3})), ShapeError);
}

TEST_CASE("the motion loss is the mean squared distance from where the flow leads") {
  const auto cameras = ThreeCameras();
  const auto pairs = SomePairs();
  // Affine flow, which bilinear look-ups reproduce exactly inside the picture.
  const auto u = torch::arange(24, torch::kFloat64) + 0.5, v = (torch::arange(16, torch::kFloat64) + 0.5).unsqueeze(1);
  const auto flow = torch::stack({(0.1 * u + 0.2 * v).expand({16, 24}), (1 - 0.05 * u + 0 * v).expand({16, 24})}, 2);
  double expected = 0;
  for (int64_t pair = 0; pair < 2; ++pair) {
    for (int64_t i = 0; i < 2; ++i) {
      const auto a = Project(cameras[pair], PointOf(pairs.key_points, pair, i));
      const auto b = Project(cameras[pair + 1], PointOf(pairs.key_points_next, pair, i));
      const double du = b.u - a.u - (0.1 * a.u + 0.2 * a.v), dv = b.v - a.v - (1 - 0.05 * a.u);
      expected += (du * du + dv * dv) / 4;
    }
  }
  const auto flows = flow.unsqueeze(0).repeat({2, 1, 1, 1});
  CHECK(MotionLoss(Stacked(), flows, pairs, 24).item<double>() == Approx(expected).epsilon(1e-10));
  // Pixels of an image twice as wide are half as large.
  CHECK(MotionLoss(Stacked(), flows, pairs, 48).item<double>() == Approx(4 * expected).epsilon(1e-10));
}

TEST_CASE("the geometry loss averages both frames of the pairs") {
  const auto cameras = ThreeCameras();
  const auto pairs = SomePairs();
  const auto depth = torch::tensor({0.9, 1.0, 1.2}, torch::kFloat64).view({3, 1, 1}).repeat({1, 16, 24});
  const double value[3] = {0.9, 1.0, 1.2};
  double expected = 0;
  for (int64_t pair = 0; pair < 2; ++pair) {
    for (int64_t i = 0; i < 2; ++i) {
      const double here = Norm(PointOf(pairs.key_points, pair, i) - cameras[pair].position) - value[pair];
      const double next = Norm(PointOf(pairs.key_points_next, pair, i) - cameras[pair + 1].position) - value[pair + 1];
      expected += (here * here + next * next) / 8;
    }
  }
  CHECK(GeometryLoss(Stacked(), depth, pairs).item<double>() == Approx(expected).epsilon(1e-10));
}

TEST_CASE("entries that are not valid are left out of the means, and none at all gives zero with a gradient") {
  auto pairs = SomePairs();
  pairs.key_points[0][1] = torch::tensor({0.0, 0.0, -5.0}, torch::kFloat64);       // behind the camera
  pairs.key_points_next[1][0] = torch::tensor({90.0, 0.0, 0.0}, torch::kFloat64);  // beside the image
  auto depth = torch::ones({3, 16, 24}, torch::kFloat64);
  auto flow = torch::zeros({3, 16, 24, 2}, torch::kFloat64);
  const auto key_points = pairs.key_points.clone().requires_grad_(true);
  pairs.key_points = key_points;
  const auto some = MotionLoss(Stacked(), flow, pairs, 320) + GeometryLoss(Stacked(), depth, pairs);
  some.backward();
  CHECK(std::isfinite(some.item<double>()));
  CHECK(torch::isfinite(key_points.grad()).all().item<bool>());
  CHECK(key_points.grad()[0][1].abs().sum().item<double>() == 0);
  CHECK(key_points.grad()[0][0].abs().sum().item<double>() > 0);
  key_points.mutable_grad().zero_();
  depth.fill_(kNan);
  flow.fill_(kNan);
  const auto none = MotionLoss(Stacked(), flow, pairs, 320) + GeometryLoss(Stacked(), depth, pairs);
  none.backward();
  CHECK(none.item<double>() == 0);
  CHECK(key_points.grad().abs().sum().item<double>() == 0);
}

TEST_CASE("key points that stand still, coincide, lie at a camera or are not finite have finite losses and gradients") {
  const auto cameras = ThreeCameras();
  const auto point = [](double x, double y, double z) { return torch::tensor({x, y, z}, torch::kFloat64); };
  const auto centre = point(cameras[0].position.x, cameras[0].position.y, cameras[0].position.z);
  struct Case {
    const char* name;
    torch::Tensor first, second;
    bool seen;  // whether the second has an image, as the first always does
  };
  const auto middle = point(0.1, 0.05, 0.1);
  const std::vector<Case> cases = {{"coincident", middle, middle, true},
                                   {"at the camera", middle, centre, false},
                                   {"in its plane", middle, centre + point(0.1, 0, 0), false},
                                   {"next to its plane", middle, centre + point(0.01, 0, 1e-9), false},
                                   {"thousands of pixels outside", middle, point(900, 0, 0), false},
                                   {"not finite", middle, point(kNan, 0, 0), false}};
  for (const auto type : {torch::kFloat32, torch::kFloat64}) {
    const auto flow = torch::zeros({2, 16, 24, 2}, type), depth = torch::ones({3, 16, 24}, type);
    for (const Case& one : cases) {
      INFO(one.name << (type == torch::kFloat32 ? ", float32" : ", float64"));
      const auto key_points = torch::stack({one.first, one.second}).unsqueeze(0).to(type).requires_grad_(true);
      const FramePairs still = {torch::zeros({1}, torch::kInt64), key_points, key_points};
      const auto tensors = StackCameras(cameras, type);
      const auto loss = MotionLoss(tensors, flow, still, 320) + GeometryLoss(tensors, depth, still);
      const auto gradient = torch::autograd::grad({loss}, {key_points})[0];
      CHECK(std::isfinite(loss.item<double>()));
      CHECK(torch::isfinite(gradient).all().item<bool>());
      CHECK(gradient[0][0].abs().sum().item<double>() > 0);
      CHECK(torch::equal(gradient[0][0], gradient[0][1]) == one.seen);
      if (!one.seen) CHECK(gradient[0][1].abs().sum().item<double>() == 0);
    }
  }
}

TEST_CASE("motion and geometry losses agree with central differences in all key points") {
  const auto pairs = SomePairs();
  torch::manual_seed(8);
  const auto flow = torch::rand({2, 16, 24, 2}, torch::kFloat64),
             depth = torch::rand({3, 16, 24}, torch::kFloat64) + 0.5;
  FramePairs moved = pairs;
  moved.key_points = Leaf(pairs.key_points);
  moved.key_points_next = Leaf(pairs.key_points_next);
  const auto loss = [&] {
    return MotionLoss(Stacked(), flow, moved, 320) * 1e-3 + GeometryLoss(Stacked(), depth, moved);
  };
  CHECK(GradientError(loss, {moved.key_points, moved.key_points_next}) < 1e-6);
}

TEST_CASE("the regularisers are means over surface points and agree with central differences") {
  const auto x = torch::tensor({{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}, {5.0, 5.0, 5.0}}, torch::kFloat64);
  const auto y = torch::tensor({{1.0, 2.0, 2.0}, {1.0, 1.0, 2.0}, {0.0, 0.0, 0.0}}, torch::kFloat64);
  const auto valid = torch::tensor({true, true, false});
  CHECK(WarpRegularisation(x, y, valid).item<double>() == 5);
  CHECK(AmbientRegularisation(y, valid).item<double>() == 5.0);
  CHECK(WarpRegularisation(x, y, torch::zeros({3}, torch::kBool)).item<double>() == 0);
  const auto leaf = Leaf(y);
  CHECK(GradientError([&] { return WarpRegularisation(x, leaf, valid); }, {leaf}) < 1e-7);
  CHECK(GradientError([&] { return AmbientRegularisation(leaf, valid); }, {leaf}) < 1e-7);
}

TEST_CASE("losses refuse maps of another size than the cameras' images") {
  CHECK_THROWS_WITH(GeometryLoss(Stacked(), torch::ones({3, 8, 12}, torch::kFloat64), SomePairs()),
                    "depth: expected the cameras' 24 x 16 pixels, found [3, 8, 12]");
}
