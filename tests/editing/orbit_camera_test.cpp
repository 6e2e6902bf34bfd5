#include "libeditnerf/editing/orbit_camera.h"

#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

namespace {

OrbitCamera Start() {
  OrbitCamera orbit;
  orbit.camera = FixtureScene().frames[2].camera;  // at (0, 0, -1), looking along z; up is -y
  orbit.target = {0.05, 0.02, 0};
  return orbit;
}

double Distance(const OrbitCamera& orbit) { return Norm(orbit.camera.position - orbit.target); }

}  // namespace

TEST_CASE("the target keeps its pixel and its distance while the camera turns around it") {
  OrbitCamera orbit = Start();
  const Projected before = Project(orbit.camera, orbit.target);
  const double distance = Distance(orbit);
  for (int i = 0; i < 200; ++i) orbit.Orbit(0.1, 0.003 * (i % 7) - 0.008);
  const Projected after = Project(orbit.camera, orbit.target);
  CHECK(after.u == Approx(before.u).margin(1e-6));
  CHECK(after.v == Approx(before.v).margin(1e-6));
  CHECK(Distance(orbit) == Approx(distance));
  CHECK_NOTHROW(orbit.camera.Check("turned camera"));
}

TEST_CASE("the camera goes to the right and over the top, and stops short of the pole") {
  OrbitCamera orbit = Start();
  orbit.target = {0, 0, 0};
  orbit.Orbit(0.3, 0);
  CHECK(orbit.camera.position.x == Approx(std::sin(0.3)));
  CHECK(orbit.camera.position.y == Approx(0).margin(1e-12));
  orbit.Orbit(0, 0.4);
  CHECK(orbit.camera.position.y == Approx(-std::sin(0.4)));
  orbit.Orbit(0, 10);
  CHECK(orbit.camera.position.y == Approx(-std::cos(0.05)));
}

TEST_CASE("panning moves what lies at the target's depth by as many pixels") {
  OrbitCamera orbit = Start();
  const Vec3 point = orbit.target;
  const Projected before = Project(orbit.camera, point);
  orbit.Pan(3, -2);
  const Projected after = Project(orbit.camera, point);
  CHECK(after.u - before.u == Approx(3));
  CHECK(after.v - before.v == Approx(-2));
}

TEST_CASE("zooming keeps to its limits") {
  OrbitCamera orbit = Start();
  orbit.nearest = 0.5;
  orbit.farthest = 2;
  const double distance = Distance(orbit);
  orbit.Zoom(0.9);
  CHECK(Distance(orbit) == Approx(0.9 * distance));
  orbit.Zoom(1e-9);
  CHECK(Distance(orbit) == Approx(0.5));
  orbit.Zoom(1e9);
  CHECK(Distance(orbit) == Approx(2));
}

TEST_CASE("half way between two rotations is half of the turn, also for half a turn") {
  const Vec3 axis = Normalized({1, 2, -1});
  for (const double angle : {1e-12, 0.3, 2.5, 3.14159265358979}) {
    const Mat3 a = RotationAround({0, 0, 1}, 0.4), b = RotationAround(axis, angle) * a;
    const Mat3 half = BetweenRotations(a, b, 0.5), twice = half * a.Transposed() * half;
    for (size_t i = 0; i < 9; ++i) {
      CHECK(twice.m[i] == Approx(b.m[i]).margin(1e-6));
      CHECK(BetweenRotations(a, b, 1).m[i] == Approx(b.m[i]).margin(1e-6));
      CHECK(BetweenRotations(a, b, 0).m[i] == Approx(a.m[i]).margin(1e-9));
    }
  }
}
