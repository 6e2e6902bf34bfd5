#include "libeditnerf/geometry/projection.h"

#include <torch/types.h>

#include <cmath>
#include <limits>

#include "libeditnerf/geometry/rays.h"
#include "tests/catch.h"
#include "tests/geometry/test_cameras.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

torch::Tensor PointsInFront(const CameraTensors& cameras, const torch::Tensor& frame) {
  const auto pixel = torch::rand({frame.size(0), 2}, torch::kFloat64) * 48;
  const Rays rays = RaysThroughPixels(cameras, frame, pixel);
  return rays.origin + rays.direction * (0.5 + torch::rand({frame.size(0), 1}, torch::kFloat64));
}

}  // namespace

TEST_CASE("projected points agree with the scalar camera and carry both depths") {
  for (const bool distorted : {false, true}) {
    const auto cameras = TestCameras(distorted);
    const CameraTensors tensors = StackCameras(cameras, torch::kFloat64);
    const auto frame = torch::randint(3, {50}, torch::kInt64);
    const auto point = torch::randn({50, 3}, torch::kFloat64);
    const ProjectedPoints projected = ProjectPoints(tensors, frame, point);
    for (int64_t i = 0; i < 50; ++i) {
      const Camera& camera = cameras[frame[i].item<int64_t>()];
      const Vec3 x{point[i][0].item<double>(), point[i][1].item<double>(), point[i][2].item<double>()};
      const Projected expected = Project(camera, x);
      if (std::abs(expected.depth) < 1e-2) continue;  // so far off the axis the tensors give up, and numbers cancel
      CHECK(projected.valid[i].item<bool>() == expected.valid);
      CHECK(projected.depth_along_axis[i].item<double>() == Approx(expected.depth).margin(1e-12));
      CHECK(projected.distance[i].item<double>() == Approx(Norm(x - camera.position)).margin(1e-12));
      CHECK(projected.pixel[i][0].item<double>() == Approx(expected.u).epsilon(1e-9).margin(1e-9));
      CHECK(projected.pixel[i][1].item<double>() == Approx(expected.v).epsilon(1e-9).margin(1e-9));
    }
  }
}

TEST_CASE("projection has the gradients of its formula") {
  const CameraTensors cameras = StackCameras(TestCameras(true), torch::kFloat64);
  const auto frame = torch::arange(9, torch::kInt64).remainder(3);
  const auto point = Leaf(PointsInFront(cameras, frame));
  const auto all = [&] {
    const ProjectedPoints projected = ProjectPoints(cameras, frame, point);
    return torch::cat({projected.pixel, projected.depth_along_axis.unsqueeze(-1), projected.distance.unsqueeze(-1)}, 1);
  };
  CHECK(GradientError(all, {point}) < 1e-7);
}

TEST_CASE("points that cannot be projected are invalid with finite values and gradients") {
  for (const bool distorted : {false, true}) {
    for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
      const auto scalar_cameras = TestCameras(distorted);
      const CameraTensors cameras = StackCameras(scalar_cameras, dtype);
      const Camera& camera = scalar_cameras[0];
      std::vector<Vec3> points = {camera.position,
                                  camera.position - camera.orientation.Row(2),
                                  camera.position + camera.orientation.Row(0),
                                  camera.position + 2e-6 * camera.orientation.Row(2) + camera.orientation.Row(1),
                                  {kNan, 0, 0},
                                  {0, kInfinity, 0},
                                  {0, 0, -kInfinity},
                                  {1e30, 0, 0}};
      std::vector<double> values;
      for (const Vec3& p : points) values.insert(values.end(), {p.x, p.y, p.z});
      const int64_t count = static_cast<int64_t>(points.size());
      auto point = torch::tensor(values, torch::kFloat64).reshape({count, 3}).to(dtype).set_requires_grad(true);
      const ProjectedPoints projected = ProjectPoints(cameras, torch::zeros({count}, torch::kInt64), point);
      CHECK_FALSE(projected.valid.any().item<bool>());
      CHECK(projected.pixel.isfinite().all().item<bool>());
      CHECK(projected.distance.isfinite().all().item<bool>());
      (projected.pixel.sum() + projected.distance.sum() + projected.depth_along_axis.sum()).backward();
      CHECK(point.grad().isfinite().all().item<bool>());
    }
  }
}

TEST_CASE("the image holds its border and nothing beyond") {
  const CameraTensors cameras = StackCameras(TestCameras(false));
  const auto inside =
      InsideImage(cameras, torch::tensor({{0.0, 0.0}, {64.0, 48.0}, {64.1, 3.0}, {3.0, -0.1}, {kNan, 1.0}}));
  CHECK(inside.equal(torch::tensor({true, true, false, false, false})));
}
