// Rigid parts fitted to exact tracks with a little noise, of a body that slides and rests or turns to and fro.
#include <cmath>

#include "libeditnerf/tracking/moving_parts.h"
#include "libeditnerf/tracking/part_candidates.h"
#include "libeditnerf/tracking/part_hinge.h"
#include "libeditnerf/tracking/part_reversal.h"
#include "libeditnerf/tracking/part_scale.h"
#include "libeditnerf/tracking/part_solver.h"
#include "libeditnerf/tracking/stillness.h"
#include "tests/catch.h"
#include "tests/tracking/tracked_body.h"

using namespace editnerf;
using namespace editnerf::tracked;

TEST_CASE("a part that slides and rests is found at its true distance, without turns") {
  Body body(Slid);
  const RigidPart part = body.Fit();
  CHECK(part.points.size() >= 55);
  CHECK_FALSE(part.turns());
  CHECK(SeenFrames(part).size() == kFrames);
  CHECK(WorstError(body, part, Slid) < 0.04);  // of a way of 0.23, from a guess that was 0.3 off
}

TEST_CASE("a part that turns has its turns") {
  Body body(Turned);
  const RigidPart part = body.Fit();
  CHECK(part.points.size() >= 50);
  CHECK(part.turns());
  CHECK(WorstError(body, part, Turned) < 0.06);  // of a way of 0.23
}

TEST_CASE("frames that do not see a part follow from those that do") {
  // Rests, opens, rests open, and closes.
  std::vector<double> truth(40, 0);
  for (size_t t = 0; t < truth.size(); ++t) {
    const double opens = std::clamp((static_cast<double>(t) - 6) / 6, 0.0, 1.0);
    truth[t] = opens - std::clamp((static_cast<double>(t) - 30) / 6, 0.0, 1.0);
  }
  RigidPart part;
  part.pose.resize(truth.size());
  const auto filled = [&](size_t first, size_t last) {
    part.seen.assign(truth.size(), true);
    std::vector<double> values = truth;
    for (size_t t = first; t <= last; ++t) part.seen[t] = false, values[t] = NAN;
    const std::vector<int64_t> others = FillBetween(part, &values);
    CHECK(others.size() == last - first + 1);
    double worst = 0;
    for (size_t t = 0; t < truth.size(); ++t) worst = std::max(worst, std::abs(values[t] - truth[t]));
    return worst;
  };
  CHECK(filled(9, 20) < 1e-9);           // it keeps the pace at which it was last seen, and rests
  CHECK(filled(20, 33) < 1e-9);          // it must have begun late enough to be where it is seen next
  CHECK(filled(8, 10) < 1e-9);           // moving at both ends: steadily
  CHECK(filled(0, 8) < 1e-9);            // before it is seen: no further than it was ever seen
  CHECK(filled(33, 39) < 1e-9);          // likewise behind
  CHECK(filled(4, 14) == Approx(0.25));  // at rest at both ends: nothing tells when, steadily
  CHECK(filled(14, 29) < 1e-9);          // at rest all the time
}

// Turned()'s axis is (0, -1, 0) through (-0.15, y, 0).
TEST_CASE("the hinge nearest to a part's poses has its axis, its place and its angles") {
  RigidPart part;
  part.center = {0.02, 0.03, 0.1};
  part.pose.resize(kFrames);
  std::vector<int64_t> frames;
  Hinge hinge;
  hinge.axis = Normalized({0.2, -1, 0.1}), hinge.through = {-0.15, 0.3, 0};
  for (int64_t t = 0; t < kFrames; ++t) {
    frames.push_back(t);
    hinge.angle.push_back(0.02 * static_cast<double>(t - 20));
  }
  SetPoses(hinge, frames, &part);
  CHECK(Norm(part.Place(20, {0.4, 0.1, 0.2}) - Vec3{0.4, 0.1, 0.2}) < 1e-12);
  CHECK(Norm(part.Place(50, hinge.through) - hinge.through) < 1e-12);
  const std::optional<Hinge> found = NearestHinge(part, frames);
  REQUIRE(found);
  const double sign = Dot(found->axis, hinge.axis) > 0 ? 1 : -1;
  CHECK(Norm(sign * found->axis - hinge.axis) < 1e-9);
  CHECK(Norm(Cross(found->through - hinge.through, hinge.axis)) < 1e-5);
  for (int64_t t = 0; t < kFrames; ++t)
    CHECK(sign * found->angle[static_cast<size_t>(t)] == Approx(hinge.angle[static_cast<size_t>(t)]).margin(1e-9));
  for (RigidPose& pose : part.pose) pose.rotation = {0, 1e-3, 0};
  CHECK_FALSE(NearestHinge(part, frames));
}

TEST_CASE("a part on a hinge is put on it, at its true distance") {
  Body body(Turned);
  const RigidPart part = body.Fit();
  for (int64_t t = 0; t < kFrames; ++t) {
    const Vec3 axis = {-0.15, 0.05, 0};
    CHECK(Norm(part.Place(t, axis) - part.Place(20, axis)) < 0.01);
  }
  CHECK(WorstError(body, part, Turned) < 0.02);
}

TEST_CASE("a part that turns and goes elsewhere is not put on a hinge") {
  const auto along = [](const Vec3& p, int64_t t) { return Turned(p, t) + 0.8 * Shift(t); };
  Body body(along);
  const RigidPart part = body.Fit();
  CHECK(part.turns());
  CHECK(WorstError(body, part, along) < 0.15);
  const std::vector<int64_t> frames = SeenFrames(part);
  const std::optional<Hinge> nearest = NearestHinge(part, frames);
  REQUIRE(nearest);
  RigidPart hinged = part;
  SetPoses(*nearest, frames, &hinged);
  double farthest = 0;
  for (const int64_t t : frames)
    farthest = std::max(farthest, Norm(hinged.Place(t, part.center) - part.Place(t, part.center)));
  CHECK(farthest > 0.02);
}

TEST_CASE("scaling a part from the cameras changes no pixel") {
  Body body(Turned);
  const RigidPart part = body.Fit(), scaled = ScaledFromCameras(body.clip, part, 1.4);
  double worst = 0;
  for (size_t i = 0; i < part.points.size(); ++i) {
    for (int64_t t = 0; t < kFrames; ++t) {
      const Camera& camera = body.clip.cameras[static_cast<size_t>(t)];
      const Projected a = Project(camera, part.Place(t, ToVec3(part.points[i].position)));
      const Projected b = Project(camera, scaled.Place(t, ToVec3(scaled.points[i].position)));
      worst = std::max({worst, std::abs(a.u - b.u), std::abs(a.v - b.v)});
    }
  }
  CHECK(worst < 1e-6);
}

TEST_CASE("a part turned inside out twice is the part, and once looks alike but costs more") {
  Body body(Turned);
  const RigidPart part = body.Fit();
  RigidPart once = InsideOut(body.clip, part);
  const RigidPart twice = InsideOut(body.clip, once);
  double worst = 0, in_depth = 0, in_image = 0;
  for (size_t i = 0; i < part.points.size(); ++i) {
    for (int64_t t = 0; t < kFrames; ++t) {
      const Camera& camera = body.clip.cameras[static_cast<size_t>(t)];
      const Vec3 place = part.Place(t, ToVec3(part.points[i].position));
      const Vec3 other = once.Place(t, ToVec3(once.points[i].position));
      worst = std::max(worst, Norm(twice.Place(t, ToVec3(twice.points[i].position)) - place));
      const Projected a = Project(camera, place), b = Project(camera, other);
      in_depth = std::max(in_depth, std::abs(a.depth - b.depth));
      in_image = std::max(in_image, std::hypot(a.u - b.u, a.v - b.v));
    }
  }
  CHECK(worst < 1e-9);
  CHECK(in_depth > 0.2);
  CHECK(in_image < 20);  // perspective; the part itself is 80 pixels wide

  // Each solved to its end, from there: the right one is left at the lower cost.
  RigidPart right = part;
  const std::vector<int64_t> frames = SeenFrames(part);
  const std::optional<double> cost = SolvePart(body.clip, body.tracks, {}, frames, &right);
  const std::optional<double> reversed = SolvePart(body.clip, body.tracks, {}, frames, &once);
  REQUIRE((cost && reversed));
  CHECK(*cost < 0.9 * *reversed);
}

// Grown from frames 40 and 50 it begins inside out; if it stayed so, points would be off by 0.27 and more.
TEST_CASE("a part that turns is not left inside out, from whichever frame it is grown") {
  for (const int64_t frame : {0, 10, 20, 30, 40, 50}) {
    CAPTURE(frame);
    Body body(Turned);
    const RigidPart part = body.Fit(frame);
    CHECK(part.points.size() >= 50);
    CHECK(WorstError(body, part, Turned) < 0.16);  // from frame 0 its distance is 0.13 too great
  }
}

TEST_CASE("a point taken back from any frame is where it was") {
  Body body(Turned);
  const RigidPart part = body.Fit();
  const Vec3 p = {0.03, -0.02, 0.05};
  for (int64_t t = 0; t < kFrames; t += 7) CHECK(Norm(part.TakeBack(t, part.Place(t, p)) - p) < 1e-9);
}

TEST_CASE("static points explain what stands still, and not what moves") {
  Body still([](const Vec3&p, int64_t) { return p; }), moving(Slid);
  const auto cost = [](const Body& body) {
    std::vector<Sighting> sightings;
    const FlowTrack& track = body.tracks[0];
    for (int64_t t = track.first; t < track.end(); ++t) sightings.push_back({t, track.At(t)});
    return CostOfStillness(body.clip, sightings, {0.5, 3});
  };
  CHECK(cost(still) < 0.1);
  CHECK(cost(moving) > kLeastGain);
}

TEST_CASE("fits to one part move as each other, fits to two do not") {
  Body sliding(Slid), other([](const Vec3&p, int64_t t) { return p - 0.8 * Shift(t); });
  const RigidPart part = sliding.Fit(), again = ScaledFromCameras(sliding.clip, part, 1.1), opposite = other.Fit();
  CHECK(MovesAs(sliding.clip, sliding.tracks, part, again));
  CHECK_FALSE(MovesAs(sliding.clip, sliding.tracks, part, opposite));
}

TEST_CASE("a part that goes along with another for a third of its way is a part of its own") {
  const auto along = [](const Vec3& p, int64_t t) {
    const Vec3 own = {-0.2, 0.1, 0.1};
    return p + Shift(std::min<int64_t>(t, 19)) + own * std::clamp((static_cast<double>(t) - 19) / 25, 0.0, 1.0);
  };
  Body sliding(Slid), other(along);
  const RigidPart part = sliding.Fit(), beside = other.Fit();
  CHECK_FALSE(MovesAs(sliding.clip, sliding.tracks, part, beside));
}

TEST_CASE("what is seen beside a part only while it rests does not join it") {
  Body body(Slid);
  const size_t own = body.tracks.size();
  for (int i = 0; i < 10; ++i) {
    const Vec3 still = Slid({-0.05 + 0.01 * i, 0.02, 0.03}, 30);
    FlowTrack track;
    track.first = 26, track.seed = 30;
    for (int64_t t = 26; t < 39; ++t) {
      const Projected at = Project(body.clip.cameras[static_cast<size_t>(t)], still);
      track.pixel.push_back({at.u, at.v});
    }
    body.tracks.push_back(track);
  }
  const RigidPart part = body.Fit();
  CHECK(part.points.size() >= 55);
  for (const PartPoint& point : part.points)
    for (const size_t i : point.tracks) CHECK(i < own);
}

TEST_CASE("too few tracks make no part, and the tracks stay free") {
  Body body(Slid);
  body.tracks.resize(5);
  std::vector<bool> taken(5, false);
  CHECK_FALSE(GrowPart(body.clip, nullptr, {20, body.tracks[0].At(20), 1.3}, &body.tracks, &taken).has_value());
  CHECK(std::count(taken.begin(), taken.end(), true) == 0);
}

TEST_CASE("a key point on a rigid part goes as far as its part and is known in every frame") {
  Body body(Turned);
  MovingParts moving;
  moving.parts.push_back({body.Fit(), 60, 1000, 1});
  moving.tracks = body.tracks;
  const std::vector<Candidate> candidates = PartCandidates(body.clip, moving);
  REQUIRE(candidates.size() == 1);
  const Candidate& candidate = candidates[0];
  CHECK(candidate.part == 0);
  CHECK(candidate.pixels.CountVisible() > kFrames / 2);
  std::vector<double> ranges;
  for (const PartPoint& point : moving.parts[0].body.points)
    ranges.push_back(PointRange(moving.parts[0].body, ToVec3(point.position)));
  std::sort(ranges.begin(), ranges.end());
  CHECK(candidate.motion.range > ranges[ranges.size() / 2]);
  for (const Vec3& p : candidate.track.position) CHECK(std::isfinite(Norm(p)));
}

TEST_CASE("a key point's reference frame is one of its part's rest, on a rail one in the middle of its way") {
  // While it goes it is seen most as all frames see it: but for the rest, the reference frame would be 28.
  Body body([](const Vec3& p, int64_t t) {
    const double way = 0.004 * static_cast<double>(std::max<int64_t>(0, t - 18));
    return p + Vec3{way, -0.2 * way, 0.4 * way};
  });
  MovingParts moving;
  moving.parts.push_back({body.Fit(), 60, 1000, 1});
  moving.tracks = body.tracks;
  const auto reference = [&] { return PartCandidates(body.clip, moving).at(0).start.frame; };
  CHECK(reference() <= 18);
  moving.parts[0].body.motion = PartMotion::kRail;
  CHECK(reference() > 20);
  CHECK(reference() < 40);
}

TEST_CASE("depths of a part are those of its points, away from its edge") {
  Body body(Slid);
  const RigidPart part = body.Fit();
  const DepthTargets targets = PartDepths(body.clip, body.tracks, part, 3);
  REQUIRE(targets.size() > 500);
  CHECK((targets.key_point == 3).all().item<bool>());
  double worst = 0;
  for (int64_t i = 0; i < targets.size(); ++i) {
    const int64_t t = targets.frame[i].item<int64_t>();
    const double middle = Norm(Shift(t) - body.clip.cameras[static_cast<size_t>(t)].position);
    worst = std::max(worst, std::abs(targets.distance[i].item<double>() / middle - 1));
  }
  CHECK(worst < 0.12);  // the body is 0.12 deep, at a distance of 1
}

TEST_CASE("least squares leaves a part as far away as it was, whatever draws its way together") {
  Body body(Slid);
  const RigidPart far = ScaledFromCameras(body.clip, body.Fit(), 1.15);
  const std::vector<int64_t> frames = SeenFrames(far);
  const auto distance = [&](const RigidPart& part) {
    double sum = 0;
    for (const int64_t t : frames)
      sum += Norm(part.Place(t, ToVec3(part.points[0].position)) - body.clip.cameras[static_cast<size_t>(t)].position);
    return sum;
  };
  PartSolverOptions options;
  options.shape = 5;  // of no weight
  RigidPart drawn = far, held = far;
  REQUIRE(SolvePart(body.clip, body.tracks, options, frames, &drawn));
  options.hold_scale = true;
  REQUIRE(SolvePart(body.clip, body.tracks, options, frames, &held));
  CHECK(distance(held) == Approx(distance(far)).epsilon(0.004));
  CHECK(distance(drawn) < 0.99 * distance(far));
}
