#include "libeditnerf/tracking/track_relation.h"

#include <cmath>
#include <functional>

#include "tests/catch.h"

using namespace editnerf;

namespace {

PointTrack Track(const std::function<Vec3(double)>& position) {
  PointTrack track;
  for (int t = 0; t < 60; ++t) {
    track.position.push_back(position(t / 60.0));
    track.visible.push_back(true);
  }
  return track;
}

// A point of a lid at this distance from its hinge along x; the lid opens and closes once and rests in between.
PointTrack Lid(double radius) {
  return Track([radius](double t) {
    const double angle = 1.2 * std::pow(std::sin(M_PI * t), 2);
    return Vec3{radius * std::cos(angle), 0.1 * radius, radius * std::sin(angle)};
  });
}

}  // namespace

TEST_CASE("points of one turning lid are one part, whatever their distance from the hinge") {
  CHECK(SameRigidPart(Lid(0.5), Lid(0.3), 0.15));
  CHECK(SameRigidPart(Lid(0.3), Lid(0.5), 0.15));
}

TEST_CASE("opposite points of a turning disk are one part although they move against each other") {
  const auto disk = [](double phase) {
    return Track([phase](double t) {
      const double angle = phase + 2 * std::pow(std::sin(M_PI * t), 2);
      return Vec3{0.3 * std::cos(angle), 0.3 * std::sin(angle), 0};
    });
  };
  CHECK(SameRigidPart(disk(0), disk(M_PI), 0.15));
}

TEST_CASE("parts that move at different times or across each other are two") {
  const PointTrack early = Track([](double t) {
    return Vec3{0, 0.2 * std::pow(std::sin(M_PI * std::min(2 * t, 1.0)), 2), 0};
  });
  const PointTrack late = Track([](double t) {
    return Vec3{1, 0.2 * std::pow(std::sin(M_PI * std::max(2 * t - 1, 0.0)), 2), 0};
  });
  CHECK(RelateTracks(early, late).distance_spread < 0.03);  // constant to second order
  CHECK_FALSE(SameRigidPart(early, late, 0.15));
  CHECK_FALSE(SameRigidPart(Lid(0.5), Track([](double t) { return Vec3{0.4 * t, 0, 0}; }), 0.15));
}

TEST_CASE("motion range and noise are measured on visible frames alone") {
  PointTrack track = Track([](double t) { return Vec3{0.1 * std::sin(2 * M_PI * t), 0, 0}; });
  track.position[30] = {100, 0, 0};
  track.visible[30] = false;
  const TrackMotion motion = MeasureTrackMotion(track);
  CHECK(motion.frames == 59);
  CHECK(motion.range == Approx(0.1).margin(0.01));
  CHECK(motion.noise < 0.001);
  CHECK(MeasureTrackMotion({}).range == 0);
  CHECK_FALSE(SameRigidPart({}, {}, 0.15));
}
