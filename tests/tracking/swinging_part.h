// A sphere on an arm that swings around an upright axis, and a part that knows it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "libeditnerf/editing/orbit_camera.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/rigid_part.h"
#include "tests/tracking/moving_spheres.h"

namespace editnerf {

struct SwingingPart {
  static constexpr int64_t kFrames = 40;
  static constexpr double kRadius = 0.25, kArm = 0.3;
  static constexpr int64_t kReach = 6;  // frames before and after the middle of a track

  static double Angle(int64_t t) {  // rests, swings, and rests
    return 0.9 * std::clamp((static_cast<double>(t) - 10) / 20, 0.0, 1.0);
  }
  static Mat3 Turn(int64_t t) { return RotationAround({0, 0, 1}, Angle(t)); }

  Sphere sphere = {kRadius, [](int64_t t) { return Turn(t) * Vec3{kArm, 0, 0} + Vec3{-0.1, 0, 0.35}; }, Turn};
  Clip clip;
  std::vector<FlowTrack> tracks;
  RigidPart part;

  SwingingPart() {
    const ClipOptions options = {kFrames, 320, 240, 0.6, 0, 0};
    clip = ClipWithoutFlow(RenderMovingSpheres({sphere}, options));
    part.center = sphere.center(0);
    part.motion = PartMotion::kHinge;
    for (int64_t t = 0; t < kFrames; ++t) {
      part.pose.push_back({{0, 0, Angle(t)}, ToArray(sphere.center(t) - sphere.center(0))});
      part.seen.push_back(true);
    }
    for (int i = -5; i <= 5; ++i) {
      for (int j = -5; j <= 5; ++j) AddPoint(Normalized({0.16 * i, 0.16 * j - 0.3, 1}));
    }
  }

  void AddPoint(const Vec3& normal) {
    const int64_t middle = 8 + static_cast<int64_t>(5 * tracks.size() % 24);
    FlowTrack track = {middle - kReach, middle, {}};
    for (int64_t t = middle - kReach; t <= middle + kReach; ++t) {
      const Projected at = Project(clip.cameras[static_cast<size_t>(t)], sphere.center(t) + Turn(t) * normal * kRadius);
      track.pixel.push_back({at.u, at.v});
    }
    part.points.push_back({{tracks.size()}, ToArray(sphere.center(0) + normal * kRadius)});
    tracks.push_back(track);
  }
};

}  // namespace editnerf
