// A ball on a stick that moves in all three dimensions and presses the keys of a small piano. A key sinks where the
// ball touches it, so that the hammer's place alone decides the state of everything.
#include <algorithm>

#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {
namespace {

using Pattern = Texture::Pattern;

constexpr int kNumKeys = 5;
constexpr double kPitch = 0.27, kKeyHalfWidth = 0.13, kKeyTop = 0.32, kKeyThickness = 0.09;
constexpr double kKeyFront = -0.42, kKeyPivot = 0.24;  // along y; a key turns about its far end
constexpr double kBallRadius = 0.18;
constexpr double kPressed = kKeyTop + kBallRadius - 0.07;  // height of the ball's centre

double KeyX(int key) { return (key - 0.5 * (kNumKeys - 1)) * kPitch; }

// The angle by which a ball at `ball` turns a key: until the ball no longer cuts into its upper face.
double KeyAngle(int key, const Vec3& ball) {
  const double dx = std::max(0.0, std::abs(ball.x - KeyX(key)) - kKeyHalfWidth);
  const double y = std::clamp(ball.y, kKeyFront, kKeyPivot - 0.1);
  const double distance2 = dx * dx + (ball.y - y) * (ball.y - y);
  if (distance2 >= kBallRadius * kBallRadius) return 0;
  const double bottom = ball.z - std::sqrt(kBallRadius * kBallRadius - distance2);
  return std::atan(std::max(0.0, kKeyTop - bottom) / (kKeyPivot - y));
}

// Origin at the ball's centre.
Body Hammer() {
  const Material stick = {{Pattern::kWood, {0.45, 0.26, 0.10}, {0.80, 0.58, 0.30}, 0.03, 3}, 0.15, 30};
  const Pose along = {RotationY(0.42) * RotationX(0.25), {}};
  Shape shaft = Frustum(0.055, 0.045, 0.70, stick);
  Shape grip =
      Frustum(0.07, 0.07, 0.22, {{Pattern::kStripes, {0.9, 0.8, 0.2}, {0.15, 0.15, 0.3}, 0.07, 4}}, {0, 0, 0.50});
  Shape end = Sphere(0.085, {{Pattern::kClouds, {0.1, 0.3, 0.5}, {0.4, 0.7, 0.9}, 0.05, 5}, 0.3, 50}, {0, 0, 0.74});
  for (Shape* shape : {&shaft, &grip, &end}) shape->object_from_shape = along * shape->object_from_shape;
  Body hammer;
  hammer.name = "hammer";
  hammer.moves = true;
  hammer.shapes = {
      Sphere(kBallRadius, {{Pattern::kMosaic, {0.75, 0.12, 0.10}, {0.95, 0.45, 0.15}, 0.09, 6, 0.5}, 0.3, 50}), shaft,
      grip, end};
  return hammer;
}

// Origin on the axis about which it turns.
Body Key(int key) {
  const double half_length = (kKeyPivot - kKeyFront) / 2;
  const auto seed = static_cast<uint64_t>(20 + key);
  const bool even = key % 2 == 0;
  const Texture face = {Pattern::kClouds, even ? Vec3{0.80, 0.76, 0.66} : Vec3{0.30, 0.55, 0.62},
                        even ? Vec3{0.95, 0.92, 0.85} : Vec3{0.45, 0.72, 0.78}, 0.10, seed};
  const Texture mark = {Pattern::kDots, {0.15, 0.12, 0.2}, {0.9, 0.6, 0.2}, 0.05, seed, 0.9};
  Body body;
  body.name = "key_" + std::to_string(key);
  body.moves = true;
  body.shapes = {Box({kKeyHalfWidth, half_length, kKeyThickness / 2}, {face, 0.25, 60}, {0, -half_length, 0}),
                 Box({0.07, 0.05, 0.006}, {mark, 0.1, 30}, {0, -2 * half_length + 0.12, kKeyThickness / 2})};
  return body;
}

Body Case() {
  const Material lacquer = {{Pattern::kWood, {0.10, 0.05, 0.05}, {0.34, 0.13, 0.10}, 0.05, 31}, 0.35, 60};
  const Material cloth = {{Pattern::kMosaic, {0.15, 0.35, 0.25}, {0.55, 0.65, 0.35}, 0.07, 32, 0.3}};
  const double half = 0.5 * kNumKeys * kPitch;
  Body body;
  body.shapes = {Box({half + 0.08, 0.40, 0.06}, lacquer, {0, -0.06, 0.06}),
                 Box({half + 0.08, 0.16, 0.29}, lacquer, {0, 0.42, 0.29}),
                 Box({half - 0.05, 0.01, 0.09}, cloth, {0, 0.255, 0.45}),
                 Box({0.04, 0.36, 0.17}, lacquer, {-half - 0.045, -0.08, 0.17}),
                 Box({0.04, 0.36, 0.17}, lacquer, {half + 0.045, -0.08, 0.17})};
  return body;
}

Track Melody() {
  struct Stroke {
    int key;
    double y, raised;
  };
  const Stroke strokes[] = {{2, -0.20, 0.72}, {0, -0.28, 0.82}, {1, -0.10, 0.66},
                            {3, -0.26, 0.90}, {4, -0.12, 0.70}, {2, -0.20, 0.72}};
  const double length = 1.0 / 6;
  Track track;
  double begin = 0;
  for (const Stroke& stroke : strokes) {
    const double x = KeyX(stroke.key);
    const State raised = {x, stroke.y, stroke.raised}, pressed = {x, stroke.y, kPressed};
    track.push_back({begin + 0.08 * length, raised});
    track.push_back({begin + 0.36 * length, pressed});
    track.push_back({begin + 0.42 * length, pressed});
    track.push_back({begin + 0.70 * length, raised});
    begin += length;
  }
  return track;
}

}  // namespace

Play KeysPlay() {
  Play play;
  play.bodies = {Hammer()};
  for (int key = 0; key < kNumKeys; ++key) play.bodies.push_back(Key(key));
  for (const Body& body :
       {Case(), Studio({0.52, 0.40, 0.34}, {0.34, 0.48, 0.46}),
        Ball({-1.15, 0.25, 0}, 0.2, {Pattern::kChecker, {0.15, 0.3, 0.6}, {0.85, 0.85, 0.8}, 0.1, 41}),
        Vase({1.15, 0.5, 0}, 0.22, 0.62, {Pattern::kDots, {0.25, 0.5, 0.3}, {0.95, 0.85, 0.6}, 0.08, 42, 0.4}),
        Block({1.0, -0.55, 0}, {0.17, 0.12, 0.06}, 0.4,
              {Pattern::kStripes, {0.6, 0.2, 0.2}, {0.9, 0.8, 0.6}, 0.06, 43}),
        Cone({-0.95, -0.6, 0}, 0.13, 0.34, {Pattern::kStripes, {0.85, 0.65, 0.15}, {0.5, 0.15, 0.4}, 0.07, 44})}) {
    play.bodies.push_back(body);
  }
  play.tracks = {Melody()};
  play.poses = [](const State& state) {
    const Vec3 ball = {state[0], state[1], state[2]};
    std::vector<Pose> poses = {{RotationY(0.35 * ball.x), ball}};
    for (int key = 0; key < kNumKeys; ++key) {
      poses.push_back({RotationX(KeyAngle(key, ball)), {KeyX(key), kKeyPivot, kKeyTop - kKeyThickness / 2}});
    }
    return poses;
  };
  play.camera.focus = {0, 0.05, 0.62};
  play.camera.distance = 4.25;
  return play;
}

}  // namespace editnerf::synthetic
