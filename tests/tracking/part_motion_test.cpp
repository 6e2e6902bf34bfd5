// Parts that were fitted to drifting tracks, and the kind of motion that their looks decide on.
#include "libeditnerf/tracking/part_motion.h"

#include <cmath>

#include "libeditnerf/editing/orbit_camera.h"
#include "libeditnerf/tracking/part_fit.h"
#include "tests/catch.h"
#include "tests/tracking/drifting_part.h"

using namespace editnerf;

namespace {

constexpr DepthRange kRange = {0.5, 5};

// Around a corner, with rests.
Vec3 Roaming(int64_t t) {
  const auto share = [t](double first) { return std::clamp((static_cast<double>(t) - first) / 8, 0.0, 1.0); };
  return {0.2 * share(6) - 0.15, 0.2 * share(22) - 0.1, 0.35};
}

// On an arm around an upright axis.
Mat3 SwingingTurn(int64_t t) {
  return RotationAround({0, 0, 1}, 0.9 * std::clamp((static_cast<double>(t) - 10) / 20, 0.0, 1.0));
}
Vec3 SwingingCenter(int64_t t) { return SwingingTurn(t) * Vec3{0.3, 0, 0} + Vec3{-0.1, 0, 0.35}; }

}  // namespace

TEST_CASE("a part that slides along a line is put on a rail, and is where it belongs there", "[part_motion]") {
  DriftingPart drifting;
  const double before = drifting.Astray(drifting.part);
  const RigidPart part = FollowByLooks(drifting.clip, drifting.part, kRange, &drifting.tracks);
  CHECK(part.motion == PartMotion::kRail);
  CHECK(before > 0.02);
  CHECK(drifting.Astray(part) < 0.25 * before);
  for (const RigidPose& pose : part.pose) CHECK(Norm(ToVec3(pose.rotation)) == 0);
}

TEST_CASE("a part that roams on a plane is put on it", "[part_motion]") {
  DriftingPart drifting({DriftingPart::kRadius, Roaming});
  const RigidPart part = FollowByLooks(drifting.clip, drifting.part, kRange, &drifting.tracks);
  CHECK(part.motion == PartMotion::kPlane);
  CHECK(drifting.Astray(part) < 0.25 * drifting.Astray(drifting.part));
}

TEST_CASE("a part that goes about in three dimensions is held to nothing", "[part_motion]") {
  const auto rising = [](int64_t t) {
    const double share = std::clamp((static_cast<double>(t) - 30) / 8, 0.0, 1.0);
    return Roaming(t) + Vec3{-0.1 * share, 0, 0.15 * share};
  };
  DriftingPart drifting({DriftingPart::kRadius, rising});
  const RigidPart part = FollowByLooks(drifting.clip, drifting.part, kRange, &drifting.tracks);
  CHECK(part.motion == PartMotion::kNoTurns);
  CHECK(drifting.Astray(part) < 0.6 * drifting.Astray(drifting.part));
}

TEST_CASE("a part that swings on an arm is put on a hinge", "[part_motion]") {
  DriftingPart drifting({DriftingPart::kRadius, SwingingCenter, SwingingTurn});
  const RigidPart part = FollowByLooks(drifting.clip, drifting.part, kRange, &drifting.tracks);
  CHECK(part.motion == PartMotion::kHinge);
  CHECK(drifting.Astray(part) < 0.5 * drifting.Astray(drifting.part));
}
