// A part that was fitted to tracks that drift on a moving sphere, which it follows but for a slow slip of its own.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "libeditnerf/tracking/rigid_part.h"
#include "tests/tracking/moving_spheres.h"

namespace editnerf {

struct DriftingPart {
  static constexpr int64_t kFrames = 40;
  static constexpr double kRadius = 0.25;
  static constexpr double kTrackDrift = 0.15;  // pixels a frame
  static constexpr int64_t kReach = 6;         // frames before and after the middle of a track

  // Rests, slides, and rests.
  static Vec3 SlidingCenter(int64_t t) {
    const double share = std::clamp((static_cast<double>(t) - 14) / 10, 0.0, 1.0);
    return {0.3 * share - 0.15, 0, 0.35};
  }

  Sphere sphere;
  Clip clip;
  std::vector<FlowTrack> tracks;
  RigidPart part;
  std::vector<Vec3> normals;  // of the sphere at the part's points, in its own axes

  explicit DriftingPart(Sphere moving = {kRadius, SlidingCenter}) : sphere(std::move(moving)) {
    const ClipOptions options = {kFrames, 320, 240, 0.6, 0, 0};
    clip = ClipWithoutFlow(RenderMovingSpheres({sphere}, options));
    part.motion = sphere.turn ? PartMotion::kFree : PartMotion::kNoTurns;
    part.center = sphere.center(0);
    for (int64_t t = 0; t < kFrames; ++t) {
      part.pose.push_back({RotationAt(t), ToArray(sphere.center(t) - sphere.center(0) + Slip(t))});
      part.seen.push_back(true);
    }
    const Vec3 towards = Normalized(clip.cameras[kFrames / 2].position - sphere.center(kFrames / 2));
    const Vec3 side = Normalized(Cross(towards, {0, 0, 1})), up = Cross(side, towards);
    for (int i = -3; i <= 3; ++i) {
      for (int j = -3; j <= 3; ++j) AddPoint(Normalized(towards + side * (0.2 * i) + up * (0.2 * j)));
    }
  }

  Mat3 Turn(int64_t t) const { return sphere.turn ? sphere.turn(t) : Mat3{{1, 0, 0, 0, 1, 0, 0, 0, 1}}; }
  // Of turns around the upright axis.
  std::array<double, 3> RotationAt(int64_t t) const {
    const Vec3 x = Turn(t) * Vec3{1, 0, 0};
    return {0, 0, std::atan2(x.y, x.x)};
  }

  Vec3 Slip(int64_t t) const { return clip.cameras[0].orientation.Row(0) * (6e-4 * static_cast<double>(t)); }

  void AddPoint(const Vec3& normal) {
    const int64_t middle = 8 + static_cast<int64_t>(5 * tracks.size() % 24);
    FlowTrack track = {middle - kReach, middle, {}};
    for (int64_t t = middle - kReach; t <= middle + kReach; ++t) {
      const Pixel at = Truth(normal, t);
      track.pixel.push_back({at.u + kTrackDrift * static_cast<double>(t - middle), at.v});
    }
    part.points.push_back({{tracks.size()}, ToArray(sphere.center(0) + normal * kRadius - Slip(middle))});
    tracks.push_back(track);
    normals.push_back(normal);
  }

  Pixel Truth(const Vec3& normal, int64_t t) const {
    const Projected at = Project(clip.cameras[static_cast<size_t>(t)], sphere.center(t) + Turn(t) * normal * kRadius);
    return {at.u, at.v};
  }

  // How far its way leads from the sphere's, scene units.
  double Astray(const RigidPart& of) const {
    double most = 0;
    for (int64_t t = 0; t < kFrames; ++t) {
      const Vec3 way = of.Place(t, of.TakeBack(0, sphere.center(0))) - sphere.center(0);
      most = std::max(most, Norm(way - (sphere.center(t) - sphere.center(0))));
    }
    return most;
  }
};

}  // namespace editnerf
