#include "libeditnerf/editing/motion_transfer.h"

#include <cmath>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

namespace {

const AffineMotion kTruth = {{0.1, -0.2, 0.3}, {0.01, 0.002, -0.003}, {-0.004, 0.02, 0.001}, 2};

double Miss(const Vec3& a, const Vec3& b) { return Norm(a - b); }

}  // namespace

TEST_CASE("an affine motion is recovered exactly from pairs that it made") {
  std::vector<Pixel> pixels = {{10, 20}, {200, 40}, {90, 150}, {30, 170}};
  std::vector<Vec3> positions;
  for (const Pixel& p : pixels) positions.push_back(kTruth.At(p));
  const AffineMotion found = FitPairs(pixels, positions);
  CHECK(found.rank == 2);
  CHECK(Miss(found.offset, kTruth.offset) < 1e-10);
  CHECK(Miss(found.along_u, kTruth.along_u) < 1e-12);
  CHECK(Miss(found.along_v, kTruth.along_v) < 1e-12);
  // Too many pairs to fit them all: least squares, whose mean is met.
  positions[3] += {0.04, 0, 0};
  Vec3 sum;
  const AffineMotion near = FitPairs(pixels, positions);
  for (size_t i = 0; i < pixels.size(); ++i) sum += near.At(pixels[i]) - positions[i];
  CHECK(Norm(sum) < 1e-10);
}

TEST_CASE("from pairs on a line, motion across the line has no effect") {
  const AffineMotion found = FitPairs({{0, 0}, {30, 40}}, {{0, 0, 0}, {0, 0, 1}});
  CHECK(found.rank == 1);
  CHECK(Miss(found.At({15, 20}), {0, 0, 0.5}) < 1e-12);
  CHECK(Miss(found.At({15 - 40, 20 + 30}), {0, 0, 0.5}) < 1e-12);
}

TEST_CASE("pairs that say nothing are refused") {
  CHECK_THROWS_WITH(FitPairs({{1, 2}}, {{0, 0, 0}}), HasText("at least two pairs"));
  CHECK_THROWS_WITH(FitPairs({{1, 2}, {1.1, 2}}, {{0, 0, 0}, {1, 0, 0}}),
                    HasText("choose frames between which it moves"));
}

TEST_CASE("a range is laid onto a range, to the side to which the view sees it go") {
  const Camera view = FixtureScene().frames[2].camera;  // at the origin's front, x to the right and y down
  std::vector<Pixel> pixels;
  std::vector<Vec3> positions;
  for (int i = 0; i <= 10; ++i) {
    const double t = i / 10.0 - 0.5;
    pixels.push_back({100 + 80 * t, 50});
    positions.push_back({-0.2 * t, 0, 0.05 * t});  // leftwards while the pixel goes to the right
  }
  const AffineMotion found = FitRanges(pixels, positions, view);
  CHECK(found.rank == 1);
  CHECK(Miss(found.At(pixels.front()), positions.back()) < 1e-9);
  CHECK(Miss(found.At(pixels.back()), positions.front()) < 1e-9);
  CHECK(Miss(found.At({100, 90}), {0, 0, 0}) < 1e-9);
  const AffineMotion reversed = FitRanges(pixels, positions, view, true);
  CHECK(Miss(reversed.At(pixels.front()), positions.front()) < 1e-9);
}

TEST_CASE("a motion with two directions keeps both, and a still one has no range") {
  const Camera view = FixtureScene().frames[2].camera;
  std::vector<Pixel> pixels;
  std::vector<Vec3> positions;
  for (int i = 0; i < 40; ++i) {
    const double angle = 2 * M_PI * i / 40;
    pixels.push_back({100 + 60 * std::cos(angle), 70 + 20 * std::sin(angle)});
    positions.push_back({0.03 * std::cos(angle), 0.01 * std::sin(angle), 0});
  }
  const AffineMotion found = FitRanges(pixels, positions, view);
  CHECK(found.rank == 2);
  for (size_t i = 0; i < pixels.size(); ++i) CHECK(Miss(found.At(pixels[i]), positions[i]) < 1e-9);
  const AffineMotion along = FitRanges(pixels, positions, view, false, 1);
  CHECK(along.rank == 1);
  CHECK(Miss(along.At({160, 90}), {0.03, 0, 0}) < 1e-9);
  CHECK_THROWS_WITH(FitRanges({{5, 5}, {5.2, 5}}, positions, view), HasText("choose one that moves"));
  CHECK_THROWS_WITH(FitRanges(pixels, {{1, 1, 1}, {1, 1, 1}}, view), HasText("does not move in the capture"));
}

TEST_CASE("what does not exist is refused before anything is fitted") {
  const KeyPointTracks tracks(FixtureTracks());
  PointTrack track;
  track.at = {{0, 0}, {10, 0}, {20, 0}};
  track.first_frame = 5;
  TransferOptions options;
  options.pairs = {{5, 0}, {7, 4}};
  const std::vector<Vec3> path = TransferMotion(track, tracks, options);
  REQUIRE(path.size() == 3);
  CHECK(Miss(path[0], tracks.Row(0)[0]) < 1e-9);
  CHECK(Miss(path[1], tracks.Row(2)[0]) < 1e-9);
  options.pairs = {{4, 0}, {7, 4}};
  CHECK_THROWS_WITH(TransferMotion(track, tracks, options), HasText("expected a frame of the video from 5 to 7"));
  options.pairs = {{5, 0}, {7, 5}};
  CHECK_THROWS_WITH(TransferMotion(track, tracks, options), HasText("training frame 5: the run has 5"));
  options.key_point = 2;
  CHECK_THROWS_WITH(TransferMotion(track, tracks, options), HasText("key point 2: the run has 2, numbered from 0"));
}

TEST_CASE("a driven edit is an edit file that moves one key point") {
  const EditFile edit =
      ParseEditFile(WriteEditFile(DrivenEdit({{0, 0, 1}, {0, 0, 2}}, 1, 12, "frame2", "frame4")), "e");
  REQUIRE(edit.frames.size() == 2);
  CHECK(edit.fps == 12);
  CHECK_FALSE(edit.frames[1].key_points[0].has_value());
  CHECK(edit.frames[1].key_points[1]->z == 2);
  CHECK(edit.frames[1].code_frame == "frame2");
  CHECK(edit.frames[1].camera_frame == "frame4");
}
