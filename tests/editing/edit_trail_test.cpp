#include "libeditnerf/editing/edit_trail.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/camera_file.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

namespace {

TrailFrame Frame(double time, double x, int64_t row = 0) {
  return {time, {Vec3{x, 0, 0}}, FixtureScene().frames[0].camera, row};
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
