// Parts that are held to a line or a plane.
#include "libeditnerf/tracking/part_slide.h"

#include <cmath>

#include "libeditnerf/tracking/part_fit.h"
#include "libeditnerf/tracking/part_scale.h"
#include "tests/catch.h"
#include "tests/tracking/tracked_body.h"

using namespace editnerf;
using namespace editnerf::tracked;

TEST_CASE("the rail nearest to a part's poses has its direction and its shifts") {
  RigidPart part;
  part.pose.resize(kFrames);
  std::vector<int64_t> frames;
  Slide rail;
  rail.axes[0] = Normalized({0.2, -1, 0.1});
  for (int64_t t = 0; t < kFrames; ++t) {
    frames.push_back(t);
    rail.place.push_back({0.01 * static_cast<double>(t - 20), 0});
    part.pose[static_cast<size_t>(t)].rotation = {0, 0, 0.1};
  }
  CHECK_FALSE(NearestSlide(part, frames, 1));
  SetPoses(rail, frames, &part);
  for (const RigidPose& pose : part.pose) CHECK(Norm(ToVec3(pose.rotation)) == 0);
  const std::optional<Slide> found = NearestSlide(part, frames, 1);
  REQUIRE(found);
  const double sign = Dot(found->axes[0], rail.axes[0]) > 0 ? 1 : -1;
  CHECK(Norm(sign * found->axes[0] - rail.axes[0]) < 1e-9);
  for (size_t t = 0; t < rail.place.size(); ++t)
    CHECK(sign * found->place[t][0] == Approx(rail.place[t][0]).margin(1e-9));
  part.seen.assign(kFrames, true);
  for (const size_t t : {0, 30, 31}) {
    part.seen[t] = false;
    part.pose[t] = {};
  }
  part.motion = PartMotion::kRail;
  FillPlaces(&part);
  CHECK(Norm(part.Place(31, {}) - rail.axes[0] * rail.place[31][0]) < 1e-9);
  CHECK(Norm(part.Place(0, {}) - rail.axes[0] * rail.place[1][0]) < 1e-9);
}

TEST_CASE("the plane nearest to a part's poses has its normal, and unknown poses lie on it") {
  RigidPart part;
  part.motion = PartMotion::kPlane;
  part.seen.assign(kFrames, true);
  std::vector<int64_t> frames;
  for (int64_t t = 0; t < kFrames; ++t) {
    frames.push_back(t);
    part.pose.push_back({{0, 0, 0.1}, ToArray(Pushed({}, t))});
  }
  CHECK_FALSE(NearestSlide(part, {3, 4}, 2));
  const std::optional<Slide> found = NearestSlide(part, frames, 2);
  REQUIRE(found);
  const Vec3 normal = Normalized(Cross(Pushed({}, 20), Pushed({}, 52)));
  CHECK(std::abs(Dot(found->axes[2], normal)) == Approx(1));
  part.seen[0] = part.seen[12] = false;
  part.pose[0] = part.pose[12] = {{0, 0, 0}, {5, 5, 5}};
  FillPlaces(&part);
  CHECK(Norm(part.Place(12, {}) - (Pushed({}, 11) + Pushed({}, 13)) / 2) < 1e-9);
  CHECK(Norm(part.Place(0, {}) - Pushed({}, 1)) < 1e-9);
}

TEST_CASE("on a rail or a plane a part has its true distance, wherever free motion left it") {
  const auto check = [](auto motion, PartMotion kind) {
    Body body(motion);
    for (const double s : {0.85, 1.15}) {
      RigidPart part = ScaledFromCameras(body.clip, body.Fit(), s);
      part.motion = kind;
      const std::vector<int64_t> frames = SeenFrames(part);
      PartSolverOptions options;
      options.shape = 0.5;
      std::optional<double> cost;
      for (int i = 0; i < 6; ++i) {
        std::optional<Slide> slide = NearestSlide(part, frames, FreedomOf(kind));
        REQUIRE(slide);
        cost = SolveSlide(body.clip, body.tracks, options, frames, &*slide, &part);
        REQUIRE(cost);
      }
      INFO(NameOf(kind) << ", begun at " << s << " times the distance; cost " << *cost);
      CHECK(WorstError(body, part, motion) < 0.02);
    }
  };
  check(Slid, PartMotion::kRail);
  check(Pushed, PartMotion::kPlane);
}

TEST_CASE("a part on a rail that rests stands still there, whatever its tracks drift") {
  Body body([](const Vec3& p, int64_t t) { return Slid(p, t) + Vec3{4e-4 * std::max<int64_t>(0, 9 - t), 0, 0}; });
  RigidPart part = body.Fit();
  part.motion = PartMotion::kRail;
  const std::vector<int64_t> frames = SeenFrames(part);
  const auto way = [&](double rest_pixels) {
    RigidPart held = part;
    PartSolverOptions options;
    options.rest_pixels = rest_pixels;
    for (int i = 0; i < 2; ++i) {
      std::optional<Slide> rail = NearestSlide(held, frames, 1);
      REQUIRE(rail);
      REQUIRE(SolveSlide(body.clip, body.tracks, options, frames, &*rail, &held));
    }
    return Norm(held.Place(0, held.center) - held.Place(8, held.center));
  };
  const double drifting = way(0), resting = way(0.3);
  INFO(drifting << " and " << resting);
  CHECK(drifting > 2e-3);
  CHECK(resting < 0.3 * drifting);
}

TEST_CASE("of a part that is held, frames in which hardly a point follows are between those beside them") {
  Body body(Slid);
  RigidPart part = body.Fit();
  part.motion = PartMotion::kRail;
  const std::vector<int64_t> frames = SeenFrames(part);
  std::optional<Slide> rail = NearestSlide(part, frames, 1);
  for (int i = 0; i < 3; ++i) {
    REQUIRE(rail);
    REQUIRE(SolveSlide(body.clip, body.tracks, {}, frames, &*rail, &part));
  }
  const auto finished = [&](int64_t first, int64_t last) {
    RigidPart lost = part;
    for (int64_t t = first; t <= last; ++t)
      lost.pose[static_cast<size_t>(t)].translation = ToArray(rail->axes[0] * 0.4);  // no track goes there
    PartFit fit(body.clip, body.tracks, {}, {0.5, 3});
    fit.GoOn(lost);
    return fit.Finished();
  };
  const RigidPart found = finished(32, 33);
  CHECK_FALSE(found.seen[32]);
  CHECK_FALSE(found.seen[33]);
  CHECK(found.seen[31]);
  for (const int64_t t : {32, 33}) CHECK(Norm(found.Place(t, part.center) - part.Place(t, part.center)) < 5e-3);
  // Where it is lost for long nothing else tells where it is.
  const RigidPart left = finished(30, 36);
  CHECK(left.seen[33]);
}
