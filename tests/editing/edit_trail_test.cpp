#include "libeditnerf/editing/edit_trail.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/editing/orbit_camera.h"
#include "libeditnerf/imaging/camera_file.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

namespace {

TrailFrame Frame(double time, double x, int64_t row = 0) {
  return {time, {Vec3{x, 0, 0}}, FixtureScene().frames[0].camera, row};
}

TrailFrame Frame(double time, const Camera& camera) { return {time, {}, camera, 0}; }

// A camera that turns around what is in the middle of its image, one unit away, and looks down on it.
OrbitCamera Orbiting() {
  OrbitCamera orbit;
  orbit.camera = FixtureScene().frames[2].camera.Resized(720, 405);  // at (0, 0, -1), looking along z
  orbit.target = {0, 0, 0};
  orbit.Orbit(0, 0.3);
  return orbit;
}

// Pixels between where two cameras see a point.
double Shift(const Camera& a, const Camera& b, const Vec3& point) {
  const Projected in_a = Project(a, point), in_b = Project(b, point);
  REQUIRE((in_a.valid && in_b.valid));
  return std::hypot(in_a.u - in_b.u, in_a.v - in_b.v);
}

double Difference(const Vec3& a, const Vec3& b) { return Norm(a - b); }
double Difference(const Mat3& a, const Mat3& b) {
  double largest = 0;
  for (size_t i = 0; i < 9; ++i) largest = std::max(largest, std::abs(a.m[i] - b.m[i]));
  return largest;
}

constexpr double kStep = 1e-4;  // seconds

// Change per second in the step that begins at `seconds`.
Vec3 Speed(const EditTrail& trail, double seconds) {
  return (trail.At(seconds + kStep).camera.position - trail.At(seconds).camera.position) / kStep;
}
Vec3 TurningSpeed(const EditTrail& trail, double seconds) {
  const Mat3 turn = trail.At(seconds + kStep).camera.orientation * trail.At(seconds).camera.orientation.Transposed();
  return Vec3{turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)} / (2 * kStep);
}

void CheckSmooth(const EditTrail& trail) {
  const double end = trail.Duration();
  for (const double seconds : {0.0, end - kStep}) {
    CHECK(Norm(Speed(trail, seconds)) < 0.01);
    CHECK(Norm(TurningSpeed(trail, seconds)) < 0.01);
  }
  for (double t = kStep; t < end - 3 * kStep; t += kStep) {
    const Vec3 speed = Speed(trail, t), turning = TurningSpeed(trail, t);
    const double jump = Difference(Speed(trail, t + kStep), speed);
    const double turn_jump = Difference(TurningSpeed(trail, t + kStep), turning);
    if (!(std::isfinite(jump) && jump < 0.01 && std::isfinite(turn_jump) && turn_jump < 0.01)) {
      FAIL("at " << t << " s the speed jumps by " << jump << ", that of turning by " << turn_jump);
    }
  }
  for (const TrailFrame& frame : trail.frames()) {
    const Camera met = trail.At(frame.time - trail.frames().front().time).camera;
    CHECK(Difference(met.position, frame.camera.position) == 0);
    CHECK(Difference(met.orientation, frame.camera.orientation) == 0);
    const double shortly_before = std::max(frame.time - trail.frames().front().time - 1e-9, 0.0);
    CHECK(Difference(trail.At(shortly_before).camera.position, frame.camera.position) < 1e-7);
    CHECK(Difference(trail.At(shortly_before).camera.orientation, frame.camera.orientation) < 1e-7);
  }
}

}  // namespace

TEST_CASE("a trail passes through its key frames and never overshoots them") {
  EditTrail trail;
  for (const auto& [time, x] : {std::pair{1.0, 0.0}, {2.0, 1.0}, {2.5, 1.0}, {4.0, 0.2}, {5.0, 0.7}}) {
    trail.Add(Frame(time, x));
  }
  CHECK(trail.Duration() == 4);
  CHECK(trail.At(0).key_points[0].x == 0);
  CHECK(trail.At(1).key_points[0].x == Approx(1));
  CHECK(trail.At(1.3).key_points[0].x == Approx(1));  // a rest stays a rest
  CHECK(trail.At(3).key_points[0].x == Approx(0.2));
  CHECK(trail.At(99).key_points[0].x == Approx(0.7));
  for (double t = 0; t <= 4; t += 0.01) {
    const double x = trail.At(t).key_points[0].x;
    CHECK((x >= -1e-12 && x <= 1 + 1e-12));
    if (t > 1.5 && t < 2.985) CHECK(trail.At(t + 0.01).key_points[0].x <= x + 1e-12);
  }
}

TEST_CASE("a trail refuses to go back in time, and replaces a key frame at the same time") {
  EditTrail trail;
  CHECK_THROWS_WITH(trail.ToEditFile(FixtureScene(), 24), HasText("there is no key frame"));
  trail.Add(Frame(1, 0));
  trail.Add(Frame(1, 5));
  CHECK(trail.frames().size() == 1);
  CHECK(trail.At(0).key_points[0].x == 5);
  CHECK_THROWS_WITH(trail.Add(Frame(0.5, 0)), HasText("expected a time of at least 1.000 s"));
  CHECK_THROWS_AS(trail.Add(Frame(1e6, 0)), DataError);
  CHECK_THROWS_AS(trail.ToEditFile(FixtureScene(), 0), DataError);
}

TEST_CASE("key frames can be replaced, moved past others and removed, and the trail begins when it began") {
  EditTrail trail;
  for (const double time : {1.0, 2.0, 3.0}) trail.Add(Frame(time, 10 * time));
  const auto holds = [&](const std::vector<std::pair<double, double>>& times_and_places) {
    bool same = trail.frames().size() == times_and_places.size();
    for (size_t i = 0; same && i < times_and_places.size(); ++i) {
      same = trail.frames()[i].time == times_and_places[i].first &&
             trail.frames()[i].key_points[0].x == times_and_places[i].second;
    }
    return same;
  };
  trail.Replace(1, Frame(9, 5));
  CHECK(holds({{1, 10}, {2, 5}, {3, 30}}));
  trail.Move(1, 2.5);
  CHECK(holds({{1, 10}, {3, 30}, {3.5, 5}}));
  trail.Move(0, 2.25);  // the second one is the first then, and begins at 1
  CHECK(holds({{1, 30}, {1.25, 10}, {1.5, 5}}));
  trail.Remove(0);
  CHECK(holds({{1, 10}, {1.25, 5}}));
  trail.Add(Frame(2, 7));
  trail.Remove(1);
  CHECK(holds({{1, 10}, {2, 7}}));

  CHECK_THROWS_WITH(trail.Replace(2, Frame(0, 0)), "key frame 2: the trail has 2, numbered from 0");
  CHECK_THROWS_WITH(trail.Remove(-1), "key frame -1: the trail has 2, numbered from 0");
  CHECK_THROWS_WITH(trail.Move(0, 1), "trail: there is a key frame at 1 s already");
  for (const double seconds : {-0.1, 300.1, std::nan("")}) CHECK_THROWS_AS(trail.Move(1, seconds), DataError);
  CHECK(holds({{1, 10}, {2, 7}}));
  trail.Remove(0);
  trail.Remove(0);
  CHECK_THROWS_WITH(trail.Remove(0), "key frame 0: the trail has 0");
}

TEST_CASE("the edit file of a trail is one that enf-render reads, with cameras in world units") {
  const Scene scene = FixtureScene();
  EditTrail trail;
  trail.Add(Frame(0, 0, 1));
  trail.Add(Frame(1, 0.5, 3));
  const EditFile edit = ParseEditFile(WriteEditFile(trail.ToEditFile(scene, 10, 64, 36)), "edit.json");
  REQUIRE(edit.frames.size() == 11);
  CHECK(edit.fps == 10);
  CHECK(edit.width == 64);
  CHECK(edit.frames[0].code_frame == "frame1");
  CHECK(edit.frames[10].code_frame == "frame3");
  CHECK(edit.frames[10].key_points[0]->x == Approx(0.5));
  const Camera camera = CameraInSceneUnits(*edit.frames[5].camera, scene.transform);
  CHECK(camera.position.x == Approx(scene.frames[0].camera.position.x));
  CHECK(camera.position.z == Approx(scene.frames[0].camera.position.z));
}

TEST_CASE("between two key frames of an orbit its target stays in the picture, and at its distance") {
  for (const Vec3& target : {Vec3{0, 0, 0}, Vec3{0.1, 0.05, 0.1}}) {  // in the middle of the image, and beside it
    OrbitCamera orbit = Orbiting();
    orbit.target = target;
    const Camera start = orbit.camera;
    EditTrail trail;
    trail.Add(Frame(1, orbit.camera));
    orbit.Orbit(3.14159265358979 / 3, 0);
    trail.Add(Frame(3, orbit.camera));
    for (double t = 0; t <= 2; t += 1.0 / 24) {
      const Camera camera = trail.At(t).camera;
      CHECK(Shift(camera, start, target) < 1e-3);
      CHECK(Norm(camera.position - target) == Approx(Norm(start.position - target)));
      CHECK_NOTHROW(camera.Check("camera on its way"));
    }
    CheckSmooth(trail);
  }
}

TEST_CASE("position and orientation share their easing") {
  OrbitCamera orbit = Orbiting();
  const Camera start = orbit.camera;
  EditTrail trail;
  trail.Add(Frame(0, orbit.camera));
  orbit.Orbit(1, 0);
  trail.Add(Frame(2, orbit.camera));
  for (const double share : {0.1, 0.25, 0.5, 0.8}) {
    OrbitCamera wanted = Orbiting();
    wanted.camera = start;
    wanted.Orbit(share * share * (3 - 2 * share), 0);
    const Camera camera = trail.At(2 * share).camera;
    CHECK(Difference(camera.position, wanted.camera.position) < 1e-6);
    CHECK(Difference(camera.orientation, wanted.camera.orientation) < 1e-6);
  }
}

TEST_CASE("a camera that comes closer as it turns keeps looking at its target") {
  OrbitCamera orbit = Orbiting();
  EditTrail trail;
  trail.Add(Frame(0, orbit.camera));
  orbit.Orbit(0.8, 0.2);
  orbit.Zoom(0.5);
  trail.Add(Frame(2, orbit.camera));
  double last = 1 + 1e-9;
  for (double t = 0; t <= 2; t += 1.0 / 24) {
    const Camera camera = trail.At(t).camera;
    CHECK(Shift(camera, orbit.camera, orbit.target) < 1e-3);
    CHECK(Norm(camera.position) <= last);
    last = Norm(camera.position) + 1e-9;
  }
  CheckSmooth(trail);
}

TEST_CASE("an orbit over three key frames passes the middle one without a jump, and stays an orbit") {
  OrbitCamera orbit = Orbiting();
  const Camera start = orbit.camera;
  EditTrail trail;
  trail.Add(Frame(0, orbit.camera));
  orbit.Orbit(0.7, 0);
  trail.Add(Frame(1, orbit.camera));
  orbit.Orbit(0.5, 0);
  trail.Add(Frame(3, orbit.camera));
  CheckSmooth(trail);
  CHECK(Norm(TurningSpeed(trail, 1)) > 0.2);  // it does not stop there
  for (double t = 0; t <= 3; t += 1.0 / 24) {
    const Camera camera = trail.At(t).camera;
    CHECK(Shift(camera, start, orbit.target) < 1e-3);
    CHECK(Norm(camera.position) == Approx(1));
  }
}

TEST_CASE("a trail of unlike moves is smooth") {
  OrbitCamera orbit = Orbiting();
  EditTrail trail;
  trail.Add(Frame(0, orbit.camera));
  orbit.Orbit(0.6, 0.1);
  trail.Add(Frame(1, orbit.camera));
  orbit.Orbit(0.5, 0.2);
  orbit.Zoom(0.8);
  trail.Add(Frame(2, orbit.camera));
  orbit.Pan(100, 20);
  trail.Add(Frame(3, orbit.camera));
  orbit.Orbit(-0.6, -0.2);
  trail.Add(Frame(3.5, orbit.camera));
  CheckSmooth(trail);
}

TEST_CASE("cameras that look at nothing together move straight, and smoothly") {
  const Camera start = Orbiting().camera;
  Camera apart = start, back = start, beside = start, skew = start;
  const auto turn = [&](const Vec3& axis, double angle) { return start.orientation * RotationAround(axis, angle); };
  apart.position = {-1, 0, -1};  // the axes meet behind the cameras
  apart.orientation = turn({0, 1, 0}, 0.5);
  back.position = {0, 0, -2};  // looks the other way, along the same axis
  back.orientation = turn({0, 1, 0}, 3.14159265358979);
  beside.position = {0.5, 0, -1};  // parallel axes
  skew.position = {0.3, -0.8, -1};
  skew.orientation = turn({0, 1, 0}, 1.2);
  for (const Camera& end : {apart, back, beside, skew, start}) {
    EditTrail trail;
    trail.Add(Frame(0, start));
    trail.Add(Frame(2, end));
    CheckSmooth(trail);
    CHECK(Difference(trail.At(0.5).camera.position, start.position + (end.position - start.position) * 0.15625) < 1e-9);
    trail.Add(Frame(3, beside));
    trail.Add(Frame(4, skew));
    CheckSmooth(trail);
  }
}
