#include "libeditnerf/geometry/camera.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/geometry/test_cameras.h"

using namespace editnerf;

TEST_CASE("projection inverts the direction through a pixel, with and without distortion") {
  for (const bool distorted : {false, true}) {
    for (const Camera& camera : TestCameras(distorted)) {
      for (double u = 0; u <= 64; u += 8) {
        for (double v = 0; v <= 48; v += 8) {
          const Vec3 direction = camera.DirectionThrough(u, v);
          CHECK(Norm(direction) == Approx(1).margin(1e-12));
          const Projected projected = Project(camera, camera.position + 2.5 * direction);
          REQUIRE(projected.valid);
          CHECK(projected.u == Approx(u).margin(1e-8));
          CHECK(projected.v == Approx(v).margin(1e-8));
        }
      }
    }
  }
}

TEST_CASE("a point at or behind the camera plane has no projection") {
  const Camera camera = TestCameras(false)[1];
  const Vec3 axis = camera.orientation.Row(2);
  CHECK_FALSE(Project(camera, camera.position).valid);
  CHECK_FALSE(Project(camera, camera.position - axis).valid);
  CHECK_FALSE(Project(camera, camera.position + camera.orientation.Row(0)).valid);
  CHECK(Project(camera, camera.position + axis).valid);
}

TEST_CASE("a resized camera sees the same directions at scaled pixel positions") {
  const Camera camera = TestCameras(true)[1];
  const Camera half = camera.Resized(32, 16);
  const Vec3 a = camera.DirectionThrough(20, 30), b = half.DirectionThrough(10, 10);
  CHECK(Norm(a - b) < 1e-12);
}

TEST_CASE("a camera with a broken field is refused by name") {
  Camera camera = TestCameras(false)[0];
  CHECK_NOTHROW(camera.Check("a.json"));
  camera.skew = std::nan("");
  CHECK_THROWS_WITH(camera.Check("a.json"), "a.json: skew: expected a finite number, found nan");
  camera = TestCameras(false)[0];
  camera.focal_length = -2;
  CHECK_THROWS_WITH(camera.Check("a.json"), "a.json: focal_length: expected a positive number, found -2");
  camera = TestCameras(false)[0];
  camera.orientation(0, 0) += 1;
  CHECK_THROWS_AS(camera.Check("a.json"), DataError);
}
