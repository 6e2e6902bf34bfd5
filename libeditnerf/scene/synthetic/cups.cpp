// Two cups that slide and lift off the ground, each in its own time.
#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {
namespace {

using Pattern = Texture::Pattern;

constexpr double kPi = 3.14159265358979323846;
constexpr double kHeight = 0.52, kBottom = 0.21, kTop = 0.29, kWall = 0.028, kFloor = 0.05;
constexpr int kHandlePieces = 6;

// Standing on the origin; the handle points along +x turned by `handle` about z.
Body Cup(const char* name, const Texture& outside, const Vec3& inside, double handle, uint64_t seed) {
  const Material glazed = {outside, 0.35, 60};
  const Material inner = {{Pattern::kClouds, inside * 0.8, inside * 1.1, 0.12, seed}, 0.15, 40};
  const Material rim = {{Pattern::kClouds, inside * 0.9, inside, 0.08, seed + 1}, 0.35, 60};
  Body cup;
  cup.name = name;
  cup.moves = true;
  cup.shapes = {Frustum(kBottom, kTop, kHeight, glazed),
                Frustum(kBottom - kWall, kTop - kWall, kHeight - kFloor, inner, {0, 0, kFloor}),
                Disk(0, kBottom, inner, {0, 0, kFloor}), Disk(0, kBottom, inner, {0, 0, 0.004}),
                Disk(kTop - kWall, kTop, rim, {0, 0, kHeight})};
  // Half a ring of short rods with round joints.
  const double radius = 0.14, thickness = 0.033;
  const auto joint = [&](int i) {
    const double angle = -kPi / 2 + kPi * i / kHandlePieces;
    return Vec3{0.235 + 0.03 * std::sin(angle) + 1.1 * radius * std::cos(angle), 0, 0.28 + radius * std::sin(angle)};
  };
  for (int i = 0; i < kHandlePieces; ++i) {
    const Vec3 from = joint(i), step = joint(i + 1) - from;
    Shape rod = Frustum(thickness, thickness, Norm(step), rim);
    rod.object_from_shape = Pose{RotationZ(handle), {}} * Pose{RotationY(std::atan2(step.x, step.z)), from};
    Shape ball = Sphere(thickness, rim);
    ball.object_from_shape = Pose{RotationZ(handle), {}} * Pose{{}, from};
    cup.shapes.push_back(rod);
    cup.shapes.push_back(ball);
  }
  return cup;
}

}  // namespace

Play CupsPlay() {
  Play play;
  play.bodies = {
      Cup("cup_left", {Pattern::kDots, {0.70, 0.10, 0.08}, {0.95, 0.88, 0.70}, 0.11, 3, 0.25}, {0.85, 0.78, 0.62}, -2.6,
          4),
      Cup("cup_right", {Pattern::kChecker, {0.08, 0.30, 0.55}, {0.75, 0.85, 0.88}, 0.10, 6}, {0.55, 0.68, 0.72}, -0.5,
          7),
      Studio({0.50, 0.42, 0.30}, {0.44, 0.36, 0.44}),
      Vase({0.0, 0.75, 0}, 0.22, 0.7, {Pattern::kStripes, {0.2, 0.45, 0.25}, {0.85, 0.85, 0.6}, 0.09, 12}),
      Ball({0.05, -0.75, 0}, 0.13, {Pattern::kMosaic, {0.9, 0.7, 0.1}, {0.7, 0.3, 0.1}, 0.07, 13, 0.5}),
      Block({-1.25, 0.6, 0}, {0.2, 0.15, 0.2}, 0.4, {Pattern::kWood, {0.35, 0.2, 0.08}, {0.7, 0.5, 0.25}, 0.04, 14}),
      Cone({1.3, 0.5, 0}, 0.17, 0.45, {Pattern::kStripes, {0.8, 0.4, 0.1}, {0.95, 0.9, 0.8}, 0.09, 15})};
  const State left_home = {-0.58, -0.20, 0}, left_back = {-0.88, 0.28, 0}, left_up = {-0.58, -0.20, 0.50},
              left_far = {-0.50, 0.25, 0.38};
  const State right_home = {0.56, 0.18, 0}, right_front = {0.86, -0.28, 0}, right_up = {0.56, 0.18, 0.50},
              right_near = {0.48, -0.30, 0.32};
  play.tracks = {{{0.00, left_home},
                  {0.04, left_home},
                  {0.12, left_up},
                  {0.16, left_up},
                  {0.24, left_back},
                  {0.38, left_back},
                  {0.46, left_home},
                  {0.50, left_home},
                  {0.58, left_far},
                  {0.61, left_far},
                  {0.69, left_back},
                  {0.80, left_back},
                  {0.88, left_up},
                  {0.91, left_up},
                  {0.99, left_home}},
                 {{0.00, right_home},
                  {0.14, right_home},
                  {0.23, right_front},
                  {0.28, right_front},
                  {0.36, right_up},
                  {0.40, right_up},
                  {0.48, right_home},
                  {0.63, right_home},
                  {0.70, right_near},
                  {0.74, right_near},
                  {0.82, right_front},
                  {0.86, right_front},
                  {0.95, right_home}}};
  play.poses = [](const State& state) {
    return std::vector<Pose>{{{}, {state[0], state[1], state[2]}}, {{}, {state[3], state[4], state[5]}}};
  };
  play.camera.focus = {0, 0.05, 0.42};
  return play;
}

}  // namespace editnerf::synthetic
