#include "libeditnerf/geometry/rays.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/geometry/test_cameras.h"

using namespace editnerf;

TEST_CASE("rays through pixels agree with the scalar camera, with and without distortion") {
  for (const bool distorted : {false, true}) {
    const auto cameras = TestCameras(distorted);
    for (const auto dtype : {torch::kFloat64, torch::kFloat32}) {
      const CameraTensors tensors = StackCameras(cameras, dtype);
      CHECK(tensors.distorted == distorted);
      const auto frame = torch::randint(3, {60}, torch::kInt64);
      const auto pixel = torch::rand({60, 2}, torch::kFloat64) * torch::tensor({64.0, 48.0}, torch::kFloat64);
      const Rays rays = RaysThroughPixels(tensors, frame, pixel);
      REQUIRE(rays.direction.scalar_type() == dtype);
      const double margin = dtype == torch::kFloat64 ? 1e-11 : 2e-6;
      for (int64_t i = 0; i < 60; ++i) {
        const Camera& camera = cameras[frame[i].item<int64_t>()];
        const Vec3 expected = camera.DirectionThrough(pixel[i][0].item<double>(), pixel[i][1].item<double>());
        CHECK(rays.direction[i][0].item<double>() == Approx(expected.x).margin(margin));
        CHECK(rays.direction[i][1].item<double>() == Approx(expected.y).margin(margin));
        CHECK(rays.direction[i][2].item<double>() == Approx(expected.z).margin(margin));
        CHECK(rays.origin[i][0].item<double>() == Approx(camera.position.x).margin(1e-6));
      }
    }
  }
}

TEST_CASE("where distortion has no inverse the undistorted direction is taken, as by the scalar camera") {
  Camera camera;
  camera.focal_length = 10;
  camera.width = camera.height = 100;
  camera.radial_distortion = {-0.5, 0, 0};
  const CameraTensors tensors = StackCameras({camera}, torch::kFloat64);
  const auto pixel = torch::tensor({{3.0, 1.0}, {90.0, 80.0}}, torch::kFloat64);
  const Rays rays = RaysThroughPixels(tensors, torch::zeros({2}, torch::kInt64), pixel);
  for (int64_t i = 0; i < 2; ++i) {
    const Vec3 expected = camera.DirectionThrough(pixel[i][0].item<double>(), pixel[i][1].item<double>());
    CHECK(rays.direction[i][0].item<double>() == Approx(expected.x).margin(1e-9));
    CHECK(rays.direction[i][2].item<double>() == Approx(expected.z).margin(1e-9));
  }
}

TEST_CASE("cameras of different sizes do not stack, and rays refuse wrong shapes") {
  auto cameras = TestCameras(false);
  const CameraTensors tensors = StackCameras(cameras);
  CHECK_THROWS_WITH(RaysThroughPixels(tensors, torch::zeros({2}, torch::kInt64), torch::zeros({3, 2})),
                    "pixel: expected shape [2, 2], found [3, 2]");
  cameras[1].width = 63;
  CHECK_THROWS_WITH(StackCameras(cameras),
                    "camera 1: expected images of 64 x 48 pixels like the first camera's, found 63 x 48");
  CHECK_THROWS_WITH(StackCameras({}), "cameras: expected at least one, found none");
}
