// A cabinet with a door that turns and a drawer that slides, and a lantern that rises behind it: three parts of three
// kinds, which hide each other.
#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {
namespace {

using Pattern = Texture::Pattern;

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kHalfWidth = 0.55, kHalfDepth = 0.25, kHeight = 0.56, kWall = 0.04;  // of the cabinet
constexpr double kDoorWidth = 0.52, kDoorThickness = 0.04;
constexpr double kDrawerFront = 0.53, kDrawerHeight = 0.20, kDrawerDepth = 0.40, kDrawerFloor = 0.30;

const Pose kWorldFromCabinet = {RotationZ(-0.12), {0, 0.05, 0}};
const Pose kCabinetFromHinge = {{}, {-kHalfWidth, -kHalfDepth, 0}};
const Vec3 kLanternPlace = {0.12, 0.62, 0};

Body Cabinet() {
  const Material wood = {{Pattern::kWood, {0.22, 0.20, 0.12}, {0.58, 0.50, 0.28}, 0.05, 41}, 0.12, 30};
  const Material cloth = {{Pattern::kDots, {0.7, 0.65, 0.55}, {0.35, 0.15, 0.2}, 0.07, 42, 0.5}};
  const double mid = kHeight / 2;
  Body cabinet;
  cabinet.shapes = {Box({kHalfWidth, kWall / 2, mid}, wood, {0, kHalfDepth - kWall / 2, mid}),
                    Box({kWall / 2, kHalfDepth, mid}, wood, {-kHalfWidth + kWall / 2, 0, mid}),
                    Box({kWall / 2, kHalfDepth, mid}, wood, {kHalfWidth - kWall / 2, 0, mid}),
                    Box({kWall / 2, kHalfDepth - 0.01, mid}, wood, {0, 0.01, mid}),
                    Box({kHalfWidth, kHalfDepth, kWall / 2}, wood, {0, 0, kWall / 2}),
                    Box({kHalfWidth + 0.02, kHalfDepth + 0.02, kWall / 2}, cloth, {0, 0, kHeight + kWall / 2}),
                    // The shelf under the drawer, and what stands behind the door.
                    Box({kHalfWidth / 2, kHalfDepth - 0.02, kWall / 2}, wood, {kHalfWidth / 2, 0.02, 0.26}),
                    Sphere(0.11, {{Pattern::kMosaic, {0.15, 0.5, 0.3}, {0.6, 0.75, 0.2}, 0.06, 43, 0.5}, 0.3, 50},
                           {-0.32, -0.02, kWall + 0.11}),
                    Box({0.07, 0.06, 0.14}, {{Pattern::kStripes, {0.8, 0.4, 0.15}, {0.95, 0.85, 0.6}, 0.05, 44}},
                        {-0.13, 0.08, kWall + 0.14}),
                    Sphere(0.09, {{Pattern::kChecker, {0.6, 0.15, 0.3}, {0.9, 0.8, 0.7}, 0.05, 45}, 0.3, 50},
                           {0.28, -0.05, kWall + 0.09})};
  for (Shape& shape : cabinet.shapes) shape.object_from_shape = kWorldFromCabinet * shape.object_from_shape;
  return cabinet;
}

// Origin at the foot of the hinge, closed along +x.
Body Door() {
  const Material panel = {{Pattern::kMosaic, {0.10, 0.22, 0.42}, {0.55, 0.65, 0.75}, 0.10, 46, 0.4}, 0.15, 40};
  const Material brass = {{Pattern::kClouds, {0.75, 0.55, 0.18}, {0.95, 0.75, 0.32}, 0.05, 47}, 0.5, 60};
  const double mid = kHeight / 2;
  Body door;
  door.name = "door";
  door.moves = true;
  door.shapes = {
      Box({kDoorWidth / 2, kDoorThickness / 2, mid - 0.01}, panel, {kDoorWidth / 2, -kDoorThickness / 2, mid}),
      Box({kDoorWidth / 2 - 0.07, 0.01, mid - 0.1}, brass, {kDoorWidth / 2, -kDoorThickness - 0.005, mid}),
      Sphere(0.035, brass, {kDoorWidth - 0.05, -kDoorThickness - 0.03, mid + 0.02})};
  return door;
}

// Cabinet coordinates, closed.
Body Drawer() {
  const Material front = {{Pattern::kDots, {0.72, 0.18, 0.10}, {0.95, 0.85, 0.55}, 0.09, 48, 0.3}, 0.15, 40};
  const Material side = {{Pattern::kWood, {0.45, 0.30, 0.14}, {0.80, 0.62, 0.36}, 0.04, 49}, 0.1, 30};
  const double x = kHalfWidth / 2, half = kDrawerFront / 2 - 0.02, mid = kDrawerFloor + kDrawerHeight / 2;
  const double middle = -kHalfDepth + kDrawerDepth / 2;
  Body drawer;
  drawer.name = "drawer";
  drawer.moves = true;
  drawer.shapes = {Box({half + 0.015, 0.02, kDrawerHeight / 2 + 0.02}, front, {x, -kHalfDepth - 0.02, mid}),
                   Box({half - 0.02, kDrawerDepth / 2, 0.01}, side, {x, middle, kDrawerFloor}),
                   Box({0.01, kDrawerDepth / 2, kDrawerHeight / 2 - 0.02}, side, {x - half + 0.03, middle, mid}),
                   Box({0.01, kDrawerDepth / 2, kDrawerHeight / 2 - 0.02}, side, {x + half - 0.03, middle, mid}),
                   Box({half - 0.03, 0.01, kDrawerHeight / 2 - 0.02}, side, {x, -kHalfDepth + kDrawerDepth, mid}),
                   Sphere(0.07, {{Pattern::kStripes, {0.2, 0.3, 0.7}, {0.85, 0.85, 0.9}, 0.05, 50}, 0.3, 50},
                          {x - 0.08, middle - 0.03, kDrawerFloor + 0.08}),
                   Box({0.16, 0.015, 0.02}, side, {x, -kHalfDepth - 0.055, mid})};
  return drawer;
}

// Standing on the origin.
Body Lantern() {
  const Material glass = {{Pattern::kStripes, {0.90, 0.70, 0.20}, {0.60, 0.22, 0.08}, 0.08, 51}, 0.35, 60};
  const Material metal = {{Pattern::kClouds, {0.15, 0.35, 0.32}, {0.35, 0.62, 0.55}, 0.06, 52}, 0.4, 50};
  Body lantern;
  lantern.name = "lantern";
  lantern.moves = true;
  lantern.shapes = {Frustum(0.17, 0.20, 0.10, metal),
                    Disk(0, 0.17, metal, {0, 0, 0.004}),
                    Disk(0, 0.20, metal, {0, 0, 0.10}),
                    Frustum(0.15, 0.13, 0.40, glass, {0, 0, 0.10}),
                    Frustum(0.20, 0.04, 0.14, metal, {0, 0, 0.50}),
                    Disk(0, 0.20, metal, {0, 0, 0.50}),
                    Sphere(0.06, metal, {0, 0, 0.68})};
  return lantern;
}

}  // namespace

Play CabinetPlay() {
  Play play;
  play.bodies = {
      Door(),
      Drawer(),
      Lantern(),
      Cabinet(),
      Studio({0.36, 0.40, 0.46}, {0.50, 0.44, 0.36}),
      Ball({-0.98, -0.15, 0}, 0.17, {Pattern::kStripes, {0.75, 0.25, 0.35}, {0.95, 0.85, 0.75}, 0.1, 53}),
      Cone({1.05, 0.15, 0}, 0.18, 0.5, {Pattern::kDots, {0.15, 0.35, 0.55}, {0.9, 0.85, 0.5}, 0.09, 54, 0.3}),
      Vase({-0.85, 0.8, 0}, 0.2, 0.6, {Pattern::kChecker, {0.7, 0.6, 0.3}, {0.3, 0.4, 0.35}, 0.1, 55})};
  const auto door = [](double time, double degrees) { return Keyframe{time, {degrees * kDegree}}; };
  const auto drawer = [](double time, double out) { return Keyframe{time, {out}}; };
  const auto lantern = [](double time, double up) { return Keyframe{time, {up}}; };
  play.tracks = {{door(0.00, 0), door(0.05, 0), door(0.17, 95), door(0.22, 95), door(0.33, 30), door(0.48, 30),
                  door(0.58, 105), door(0.63, 105), door(0.76, 0), door(0.86, 0), door(0.97, 60)},
                 {drawer(0.00, 0.05), drawer(0.20, 0.05), drawer(0.30, 0.30), drawer(0.36, 0.30), drawer(0.45, 0.12),
                  drawer(0.60, 0.12), drawer(0.70, 0.34), drawer(0.75, 0.34), drawer(0.86, 0.05), drawer(1.00, 0.05)},
                 {lantern(0.00, 0.30), lantern(0.10, 0.00), lantern(0.14, 0.00), lantern(0.26, 0.55),
                  lantern(0.40, 0.55), lantern(0.52, 0.15), lantern(0.56, 0.15), lantern(0.66, 0.45),
                  lantern(0.72, 0.45), lantern(0.84, 0.05), lantern(0.88, 0.05), lantern(1.00, 0.55)}};
  play.poses = [](const State& state) {
    return std::vector<Pose>{kWorldFromCabinet * kCabinetFromHinge * Pose{RotationZ(-state[0]), {}},
                             kWorldFromCabinet * Pose{{}, {0, -state[1], 0}},
                             {{}, kLanternPlace + Vec3{0, 0, state[2]}}};
  };
  play.camera.focus = {0, 0.1, 0.45};
  return play;
}

}  // namespace editnerf::synthetic
