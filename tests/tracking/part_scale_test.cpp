// A ball that rests, slides and rests before a camera that goes around it, followed without error but for its distance.
#include "libeditnerf/tracking/part_scale.h"

#include <algorithm>
#include <cmath>

#include "tests/catch.h"
#include "tests/tracking/moving_spheres.h"

using namespace editnerf;

namespace {

constexpr int64_t kFrames = 60;

// `share` of the way from one place to the other, at frame t.
template <class Share>
RigidPart FollowedBall(const Share& share, const Vec3& way = {0.3, 0, 0}) {
  RigidPart part;
  part.reference = kFrames / 2;
  part.center = Vec3{0, 0, 0.35} + way * share(part.reference);
  for (int64_t t = 0; t < kFrames; ++t) {
    part.pose.push_back({{0, 0, 0}, ToArray(way * (share(t) - share(part.reference)))});
    part.seen.push_back(true);
  }
  for (const Vec3& offset : {Vec3{0, -0.2, 0}, Vec3{0.1, -0.15, 0.05}, Vec3{-0.1, -0.15, -0.05}}) {
    part.points.push_back({{}, ToArray(part.center + offset)});
  }
  return part;
}

double RestThenSlide(int64_t t) { return std::clamp((static_cast<double>(t) - 22) / 16, 0.0, 1.0); }

Clip BeforeCamera(double orbit) {
  const Sphere still = {0.1, [](int64_t) { return Vec3{0, 0, 0.35}; }};
  const MovingSpheres rendered = RenderMovingSpheres({still}, {kFrames, 32, 24, orbit, 0, 0});
  Clip clip;
  clip.width = 32, clip.height = 24;
  for (int64_t t = 0; t < kFrames; ++t) clip.cameras.push_back(rendered.scene.frames[static_cast<size_t>(t)].camera);
  return clip;
}

}  // namespace

TEST_CASE("a part is as far away as it has to be to stand still where it rests") {
  const Clip clip = BeforeCamera(0.8);
  const RigidPart part = FollowedBall(RestThenSlide);
  for (const double off : {0.87, 0.985, 1.0, 1.006, 1.02, 1.2}) {
    INFO(off);
    const std::optional<double> scale = RestingScale(clip, ScaledFromCameras(clip, part, off));
    REQUIRE(scale);
    CHECK(*scale == Approx(1 / off).margin(3e-4));
  }
}

TEST_CASE("where nothing rests, or the camera does, rests do not tell how far away a part is") {
  const auto always = [](int64_t t) { return static_cast<double>(t) / 12; };
  const Clip clip = BeforeCamera(0.8);
  CHECK_FALSE(RestingScale(clip, ScaledFromCameras(clip, FollowedBall(always), 1.01)));
  const Clip standing = BeforeCamera(0);
  CHECK_FALSE(RestingScale(standing, ScaledFromCameras(standing, FollowedBall(RestThenSlide), 1.01)));
}

TEST_CASE("a part that moves all the time is as far away as it has to be not to follow the camera") {
  const Clip clip = BeforeCamera(0.8);
  const auto bounces = [](int64_t t) { return std::sin(0.35 * static_cast<double>(t)); };
  const RigidPart part = FollowedBall(bounces, {0, 0, 0.3});  // across the way of the camera
  for (const double off : {0.8, 0.95, 1.0, 1.1, 1.3}) {
    INFO(off);
    CHECK(ShortestWay(clip, {}, ScaledFromCameras(clip, part, off)) == Approx(1 / off).epsilon(0.025));
  }
}
