// A rigid body with exact tracks but for a little noise: cameras on a path with steps of its own, and depth maps that
// are a third off.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "libeditnerf/tracking/part_growth.h"
#include "tests/catch.h"

namespace editnerf::tracked {

constexpr int64_t kFrames = 60, kWidth = 320, kHeight = 180;
constexpr double kPi = 3.14159265358979323846;

inline Camera CameraAt(int64_t t) {
  const double angle = 0.25 * std::sin(0.11 * static_cast<double>(t)) + 0.05 * std::sin(0.9 * static_cast<double>(t));
  Camera camera;
  camera.position = {std::sin(angle), 0.06 * std::cos(0.5 * static_cast<double>(t)), -std::cos(angle)};
  const Vec3 axis = Normalized(-camera.position), right = Normalized(Cross({0, 1, 0}, axis));
  const Vec3 down = Cross(axis, right);
  camera.orientation = {{right.x, right.y, right.z, down.x, down.y, down.z, axis.x, axis.y, axis.z}};
  camera.focal_length = 300;
  camera.principal_point = {160, 90};
  camera.width = kWidth, camera.height = kHeight;
  return camera;
}

// Slides for half of the time, and rests.
inline Vec3 Shift(int64_t t) {
  const double s = std::min(1.0, std::max(0.0, (static_cast<double>(t) - 10) / 15)) -
                   std::min(1.0, std::max(0.0, (static_cast<double>(t) - 40) / 15));
  return {0.2 * s, -0.05 * s, 0.1 * s};
}

// A lid's way: about an axis through the body's side.
inline Vec3 Turned(const Vec3& p, int64_t t) {
  const double angle = 0.9 * 0.5 * (1 - std::cos(2 * kPi * static_cast<double>(t) / 30));
  const double x = p.x + 0.15, c = std::cos(angle), s = std::sin(angle);
  return {c * x + s * p.z - 0.15, p.y, -s * x + c * p.z};
}

struct Body {
  std::vector<Vec3> points;
  std::vector<FlowTrack> tracks;
  Clip clip;

  template <class Motion>
  explicit Body(const Motion& motion, double noise = 0.2) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> unit(-1, 1);
    std::normal_distribution<double> error(0, noise);
    clip.width = kWidth, clip.height = kHeight;
    for (int64_t t = 0; t < kFrames; ++t) {
      clip.cameras.push_back(CameraAt(t));
      // A third too far, and differently so from frame to frame: nothing agrees.
      clip.depth.push_back(torch::full({kHeight, kWidth}, 1.33 + 0.3 * std::sin(static_cast<double>(t))));
      clip.gray.push_back(torch::zeros({kHeight, kWidth}));
    }
    for (int i = 0; i < 60; ++i) points.push_back({0.12 * unit(random), 0.08 * unit(random), 0.06 * unit(random)});
    for (size_t i = 0; i < points.size(); ++i) {
      FlowTrack track;
      track.first = static_cast<int64_t>(i % 4) * 5;  // they begin and end at different times
      track.seed = track.first + 10;
      const int64_t end = kFrames - static_cast<int64_t>(i % 3) * 8;
      for (int64_t t = track.first; t < end; ++t) {
        const Projected at = Project(clip.cameras[static_cast<size_t>(t)], motion(points[i], t));
        track.pixel.push_back({at.u + error(random), at.v + error(random)});
      }
      tracks.push_back(track);
    }
  }

  RigidPart Fit(int64_t frame = 20) {
    std::vector<bool> taken(tracks.size(), false);
    const Pixel seed = tracks[0].At(frame);
    GrowthOptions options;
    options.range = {0.5, 3};
    std::optional<RigidPart> part = GrowPart(clip, nullptr, {frame, seed, 1.3}, &tracks, &taken, options);
    REQUIRE(part.has_value());
    return *part;
  }
};

template <class Motion>
double WorstError(const Body& body, const RigidPart& part, const Motion& motion) {
  double worst = 0;
  for (const PartPoint& point : part.points)
    for (int64_t t = 0; t < kFrames; ++t)
      worst = std::max(worst, Norm(part.Place(t, ToVec3(point.position)) - motion(body.points[point.tracks[0]], t)));
  return worst;
}

inline Vec3 Slid(const Vec3& p, int64_t t) { return p + Shift(t); }

// About on a plane: along one line, and from there along another.
inline Vec3 Pushed(const Vec3& p, int64_t t) {
  return Slid(p, t) + Vec3{-0.05, 0.02, 0.15} * std::clamp((static_cast<double>(t) - 30) / 12, 0.0, 1.0);
}

}  // namespace editnerf::tracked
