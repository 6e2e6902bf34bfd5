#include "libeditnerf/editing/edit_session.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

namespace {

bool Same(const Vec3& a, const Vec3& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

}  // namespace

TEST_CASE("a session starts at the middle training frame, with nothing to undo") {
  EditSession session(FixtureEditableScene());
  CHECK(session.state().row == 2);
  CHECK(session.capture_camera() == 2);
  CHECK(session.state().key_points.size() == 2);
  CHECK(Same(session.state().key_points[0], session.scene().tracks.Row(2)[0]));
  CHECK_FALSE(session.can_undo());
  CHECK_FALSE(session.Undo());
  CHECK_FALSE(session.Redo());
}

TEST_CASE("a dragged key point lies at the pixel, at the mean depth of the training positions nearest to it") {
  EditSession session(FixtureEditableScene());
  session.MoveToPixel(0, 20, 7);
  const Handle handle = session.HandleOf(0);
  CHECK(handle.u == Approx(20));
  CHECK(handle.v == Approx(7));
  // Fewer than eight positions: all five count.
  CHECK(handle.depth == Approx(1.05));
  const KeyPointTracks& tracks = session.scene().tracks;
  const Projected last = Project(session.camera(), tracks.Row(4)[0]);
  CHECK(*tracks.DragDepth(session.camera(), 0, last.u, last.v, 1) == Approx(1.1));
  CHECK(*tracks.DragDepth(session.camera(), 0, last.u, last.v, 2) == Approx((1.1 + 1.075) / 2));
}

TEST_CASE("a changed depth stays on the ray, and is kept while the key point is dragged on") {
  EditSession session(FixtureEditableScene());
  session.MoveToPixel(0, 20, 7);
  session.ScaleDepth(0, 1.2);
  CHECK(session.HandleOf(0).u == Approx(20));
  CHECK(session.HandleOf(0).v == Approx(7));
  CHECK(session.HandleOf(0).depth == Approx(1.2 * 1.05));
  session.Nudge(0, -3, 2);
  CHECK(session.HandleOf(0).u == Approx(17));
  CHECK(session.HandleOf(0).depth == Approx(1.2 * 1.05));
  session.Reset(0);
  session.MoveToPixel(0, 20, 7);
  CHECK(session.HandleOf(0).depth == Approx(1.05));
  session.ScaleDepth(0, 1e9);
  CHECK(session.HandleOf(0).depth == Approx(8));  // four times the far distance
}

TEST_CASE("one gesture is undone in one step, and redone exactly") {
  EditSession session(FixtureEditableScene());
  const Vec3 start = session.state().key_points[0];
  for (int i = 0; i < 10; ++i) session.MoveToPixel(0, 10 + i, 5, 7);
  const Vec3 end = session.state().key_points[0];
  session.MoveToPixel(1, 3, 3, 8);
  REQUIRE(session.Undo());
  CHECK(Same(session.state().key_points[0], end));
  REQUIRE(session.Undo());
  CHECK(Same(session.state().key_points[0], start));
  CHECK_FALSE(session.can_undo());
  REQUIRE(session.Redo());
  CHECK(Same(session.state().key_points[0], end));
  session.Nudge(0, 1, 0, 7);  // a new change ends what could be redone, whatever its gesture
  CHECK_FALSE(session.can_redo());
  REQUIRE(session.Undo());
  CHECK(Same(session.state().key_points[0], end));
}

TEST_CASE("what is done to the trail is undone as well, a recording in one step and the drags in it in theirs") {
  EditSession session(FixtureEditableScene());
  const Vec3 start = session.state().key_points[0];
  const auto frames = [&] { return session.trail().frames().size(); };
  for (int i = 0; i < 5; ++i) {
    session.AddKeyFrame(i, 1);
    session.MoveToPixel(0, 10 + i, 5, i < 3 ? 2 : 3);
  }
  const Vec3 end = session.state().key_points[0];
  session.Undo();  // the second drag
  session.Undo();
  CHECK(Same(session.state().key_points[0], start));
  CHECK(frames() == 5);
  session.Undo();
  CHECK(frames() == 0);
  CHECK_FALSE(session.can_undo());
  for (int i = 0; i < 3; ++i) session.Redo();
  CHECK(frames() == 5);
  CHECK(Same(session.state().key_points[0], end));

  session.RemoveKeyFrame(4, 9);  // and shows another, in the same gesture
  session.ShowTrail(0, 9);
  CHECK(Same(session.state().key_points[0], start));
  session.Undo();
  CHECK(frames() == 5);
  CHECK(Same(session.state().key_points[0], end));
  session.MoveKeyFrame(4, 1.5);
  session.ReplaceKeyFrame(2);
  CHECK(Same(session.trail().frames()[2].key_points[0], end));
  session.ClearTrail();
  session.ClearTrail();  // of nothing there is nothing to undo
  session.Undo();
  CHECK(frames() == 5);
  session.Undo();
  session.Undo();
  CHECK(session.trail().Duration() == 4);
}

TEST_CASE("mistakes with key frames leave the trail and what can be undone alone") {
  EditSession session(FixtureEditableScene());
  session.AddKeyFrame(1);
  CHECK_THROWS_AS(session.AddKeyFrame(0.5), DataError);
  CHECK_THROWS_AS(session.MoveKeyFrame(0, -1), DataError);
  CHECK_THROWS_AS(session.RemoveKeyFrame(1), DataError);
  CHECK_THROWS_AS(session.ReplaceKeyFrame(1), DataError);
  CHECK(session.Undo());
  CHECK_FALSE(session.can_undo());
}

TEST_CASE("of changes to long trails fewer are kept, and always the last") {
  EditSession session(FixtureEditableScene());
  for (size_t i = 0; i < EditTrail::kMaxFrames; ++i) session.AddKeyFrame(0.01 * static_cast<double>(i), 1);
  for (int i = 0; i < 30; ++i) session.ReplaceKeyFrame(i);
  int steps = 0;
  while (session.Undo()) ++steps;
  CHECK(steps == 10);
  for (int i = 0; i < 300; ++i) session.Nudge(0, 0.1, 0);
  for (steps = 0; session.Undo();) ++steps;
  CHECK(steps == 200);
}

TEST_CASE("snapping takes key points and codes of a training frame, and resets go back to it") {
  EditSession session(FixtureEditableScene());
  session.SnapTo(4);
  CHECK(session.state().row == 4);
  CHECK(Same(session.state().key_points[1], session.scene().tracks.Row(4)[1]));
  session.SetPosition(0, {0.3, 0.1, 0});
  session.SetPosition(1, {0.3, 0.1, 0});
  session.Reset(1);
  CHECK(session.state().key_points[0].x == 0.3);
  CHECK(Same(session.state().key_points[1], session.scene().tracks.Row(4)[1]));
  session.ResetAll();
  CHECK(Same(session.state().key_points[0], session.scene().tracks.Row(4)[0]));
}

TEST_CASE("a handle says how far it is from what training saw, as a share of the trajectory's extent") {
  EditSession session(FixtureEditableScene());
  CHECK(session.HandleOf(0).reach.level == ReachLevel::kNear);
  CHECK(session.HandleOf(0).reach.distance == 0);
  session.SetPosition(0, {0.1, 0.04, 0.1});  // 0.04 from the last position; the extent is 0.2
  CHECK(session.HandleOf(0).reach.distance == Approx(0.04));
  CHECK(session.HandleOf(0).reach.share == Approx(0.2));
  CHECK(session.HandleOf(0).reach.level == ReachLevel::kFar);
  session.SetPosition(0, {0.1, 0.1, 0.1});
  CHECK(session.HandleOf(0).reach.level == ReachLevel::kBeyond);
  session.SetPosition(0, {0, 0, -5});
  CHECK_FALSE(session.HandleOf(0).in_front);
}

TEST_CASE("mistakes are refused with what was expected, and change nothing") {
  EditSession session(FixtureEditableScene());
  CHECK_THROWS_WITH(session.MoveToPixel(2, 1, 1), "key point 2: the run has 2, numbered from 0");
  CHECK_THROWS_WITH(session.SnapTo(5), "training frame 5: the run has 5, numbered from 0");
  CHECK_THROWS_WITH(session.UseCaptureCamera(-1), "camera -1: the run has 5, numbered from 0");
  CHECK_THROWS_AS(session.MoveToPixel(0, std::nan(""), 1), DataError);
  CHECK_THROWS_AS(session.ScaleDepth(0, 0), DataError);
  CHECK_THROWS_AS(session.SetPosition(0, {std::nan(""), 0, 0}), DataError);
  CHECK_THROWS_AS(session.Zoom(-1), DataError);
  CHECK_THROWS_WITH(session.ShowTrail(0), "trail: there is no key frame");
  CHECK_FALSE(session.can_undo());
}

TEST_CASE("a static scene has a camera to move and no key points") {
  auto scene = std::make_shared<EditableScene>();
  scene->scene = FixtureScene();
  EditSession session(scene);
  CHECK(session.state().key_points.empty());
  session.SnapTo(1);
  session.Orbit(0.2, 0.1);
  session.AddKeyFrame(0);
  CHECK(session.trail().ToEditFile(scene->scene, 24).frames.size() == 1);
}
