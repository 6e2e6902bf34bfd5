// A chest whose lid turns on a hinge.
#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {
namespace {

using Pattern = Texture::Pattern;

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kHalfWidth = 0.50, kHalfDepth = 0.35, kHeight = 0.42, kWall = 0.04;  // of the chest
constexpr double kLidThickness = 0.10;

const Pose kWorldFromChest = {RotationZ(0.22), {0.05, 0.05, 0}};
const Pose kChestFromHinge = {{}, {0, kHalfDepth, kHeight}};

Body Chest() {
  const Material wood = {{Pattern::kWood, {0.30, 0.15, 0.06}, {0.62, 0.36, 0.16}, 0.045, 3}, 0.12, 30};
  const Material brass = {{Pattern::kClouds, {0.75, 0.55, 0.18}, {0.95, 0.75, 0.32}, 0.05, 4}, 0.5, 60};
  const double mid = kHeight / 2;
  Body chest;
  chest.shapes = {Box({kHalfWidth, kWall / 2, mid}, wood, {0, -kHalfDepth + kWall / 2, mid}),
                  Box({kHalfWidth, kWall / 2, mid}, wood, {0, kHalfDepth - kWall / 2, mid}),
                  Box({kWall / 2, kHalfDepth - kWall, mid}, wood, {-kHalfWidth + kWall / 2, 0, mid}),
                  Box({kWall / 2, kHalfDepth - kWall, mid}, wood, {kHalfWidth - kWall / 2, 0, mid}),
                  Box({kHalfWidth - kWall, kHalfDepth - kWall, kWall / 2}, wood, {0, 0, kWall / 2}),
                  Box({0.035, 0.012, mid}, brass, {-0.3, -kHalfDepth - 0.01, mid}),
                  Box({0.035, 0.012, mid}, brass, {0.3, -kHalfDepth - 0.01, mid}),
                  Sphere(0.12, {{Pattern::kDots, {0.85, 0.75, 0.2}, {0.7, 0.1, 0.1}, 0.06, 5, 0.6}, 0.3, 50},
                         {-0.18, 0.05, kWall + 0.12}),
                  Box({0.13, 0.11, 0.07}, {{Pattern::kChecker, {0.15, 0.5, 0.45}, {0.8, 0.85, 0.75}, 0.05, 6}},
                      {0.2, -0.03, kWall + 0.07})};
  for (Shape& shape : chest.shapes) shape.object_from_shape = kWorldFromChest * shape.object_from_shape;
  return chest;
}

// Origin on the hinge, the closed lid towards -y.
Body Lid() {
  const Material panel = {{Pattern::kDots, {0.05, 0.16, 0.42}, {0.85, 0.70, 0.35}, 0.10, 7, 0.75}, 0.15, 40};
  const Material brass = {{Pattern::kClouds, {0.75, 0.55, 0.18}, {0.95, 0.75, 0.32}, 0.05, 8}, 0.5, 60};
  const double mid = kLidThickness / 2;
  Body lid;
  lid.name = "lid";
  lid.moves = true;
  lid.shapes = {Box({kHalfWidth + 0.01, kHalfDepth + 0.01, mid}, panel, {0, -kHalfDepth - 0.01, mid}),
                Box({0.035, kHalfDepth + 0.015, mid + 0.01}, brass, {-0.3, -kHalfDepth - 0.02, mid}),
                Box({0.035, kHalfDepth + 0.015, mid + 0.01}, brass, {0.3, -kHalfDepth - 0.02, mid}),
                Sphere(0.05, brass, {0, -2 * kHalfDepth - 0.05, mid})};
  return lid;
}

}  // namespace

Play HingePlay() {
  Play play;
  play.bodies = {
      Lid(),
      Chest(),
      Studio({0.42, 0.50, 0.30}, {0.38, 0.42, 0.55}),
      Ball({-0.95, -0.1, 0}, 0.19, {Pattern::kStripes, {0.85, 0.35, 0.10}, {0.95, 0.88, 0.75}, 0.13, 11}),
      Cone({0.95, 0.45, 0}, 0.18, 0.5, {Pattern::kDots, {0.1, 0.45, 0.35}, {0.95, 0.9, 0.5}, 0.09, 12, 0.3}),
      Vase({-0.75, 0.85, 0}, 0.2, 0.6, {Pattern::kStripes, {0.75, 0.75, 0.8}, {0.25, 0.3, 0.6}, 0.1, 13}),
      Block({0.9, -0.35, 0}, {0.14, 0.1, 0.12}, 0.5, {Pattern::kChecker, {0.7, 0.2, 0.35}, {0.9, 0.8, 0.8}, 0.06, 14})};
  const auto at = [](double time, double degrees) { return Keyframe{time, {degrees * kDegree}}; };
  play.tracks = {{at(0.00, 0), at(0.05, 0), at(0.16, 100), at(0.21, 100), at(0.31, 35), at(0.35, 35), at(0.45, 85),
                  at(0.49, 85), at(0.61, 0), at(0.65, 0), at(0.75, 60), at(0.79, 60), at(0.88, 100), at(0.92, 100),
                  at(1.00, 35)}};
  play.poses = [](const State& state) {
    const Pose turn = {RotationX(-state[0]), {}};
    return std::vector<Pose>{kWorldFromChest * kChestFromHinge * turn};
  };
  play.camera.focus = {0, 0.05, 0.48};
  return play;
}

}  // namespace editnerf::synthetic
