#include "libeditnerf/scene/synthetic/camera_path.h"

#include "libeditnerf/scene/synthetic/texture.h"

namespace editnerf::synthetic {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kSweeps = 1.37;  // there-and-back passes over the arc; no simple ratio to any part's motion

struct Hold {
  double azimuth, elevation, distance;
  Vec3 focus;
};

// A slow drift with two incommensurable waves, in [-1, 1].
double Wander(double t, double rate, uint64_t seed, uint64_t channel) {
  const double a = kTwoPi * HashUnit(seed, channel, 1), b = kTwoPi * HashUnit(seed, channel, 2);
  return 0.7 * std::sin(kTwoPi * rate * t + a) + 0.3 * std::sin(kTwoPi * 2.7 * rate * t + b);
}

Hold HoldAt(const CameraPathOptions& options, double t) {
  const uint64_t seed = options.seed;
  Hold hold;
  hold.azimuth = options.half_arc * (0.94 * std::sin(kTwoPi * (kSweeps * t + 0.6)) + 0.06 * Wander(t, 4.1, seed, 31));
  hold.elevation = options.elevation + 0.12 * Wander(t, 1.9, seed, 32);
  hold.distance = options.distance * (1 + 0.05 * Wander(t, 1.3, seed, 33));
  hold.focus = options.focus + Vec3{0.06 * Wander(t, 2.3, seed, 34), 0, 0.04 * Wander(t, 2.9, seed, 35)};
  return hold;
}

Camera Look(const CameraPathOptions& options, const Hold& hold) {
  const double across = std::cos(hold.elevation);
  const Vec3 back = {across * std::sin(hold.azimuth), -across * std::cos(hold.azimuth), std::sin(hold.elevation)};
  const Vec3 forward = -back;
  const Vec3 right = Normalized(Cross(forward, {0, 0, 1}));
  const Vec3 down = Cross(forward, right);
  Camera camera;
  camera.orientation = {{right.x, right.y, right.z, down.x, down.y, down.z, forward.x, forward.y, forward.z}};
  camera.position = hold.focus + back * hold.distance;
  camera.width = options.width;
  camera.height = options.height;
  camera.focal_length = options.focal_widths * static_cast<double>(options.width);
  camera.principal_point = {0.5 * static_cast<double>(options.width), 0.5 * static_cast<double>(options.height)};
  return camera;
}

}  // namespace

Camera TrainingCamera(const CameraPathOptions& options, double t) { return Look(options, HoldAt(options, t)); }

Camera NovelCamera(const CameraPathOptions& options, double t, uint64_t number) {
  Hold hold = HoldAt(options, t);
  const auto side = [&](uint64_t channel) {  // at least half the reach, to either side
    const double x = 2 * HashUnit(options.seed, channel, number, 7) - 1;
    return std::copysign(0.5 + 0.5 * std::abs(x), x);
  };
  hold.azimuth += 0.14 * side(41);
  if (std::abs(hold.azimuth) > options.half_arc) hold.azimuth -= 0.28 * std::copysign(1.0, hold.azimuth);
  hold.elevation += 0.06 * side(42);
  hold.distance *= 1 + 0.03 * side(43);
  return Look(options, hold);
}

}  // namespace editnerf::synthetic
