// One to three parts drawn by lot, that slide, roam, rise or turn: scenes that nothing was made for.
#include <algorithm>

#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {
namespace {

using Pattern = Texture::Pattern;

constexpr double kPi = 3.14159265358979323846;
constexpr double kReach = 1.0;  // of parts from the middle, world units
constexpr double kGap = 0.08;   // between parts at rest
constexpr int kTries = 1000;

enum class Motion { kSlides, kRoams, kRises, kTurns };
constexpr Motion kMotions[] = {Motion::kSlides, Motion::kRoams, Motion::kRises, Motion::kTurns};
constexpr const char* kMotionNames[] = {"slides", "roams", "rises", "turns"};

class Lots {
 public:
  explicit Lots(uint64_t seed) : seed_(seed) {}
  double Between(double low, double high) { return low + (high - low) * HashUnit(seed_, 77, ++drawn_); }
  int Below(int count) { return std::min(count - 1, static_cast<int>(Between(0, count))); }
  uint64_t Seed() { return static_cast<uint64_t>(Below(100000)); }

 private:
  uint64_t seed_, drawn_ = 0;
};

Vec3 AnyColor(Lots* lots, double brightness) {
  const double hue = lots->Between(0, 2 * kPi), vivid = lots->Between(0.3, 0.9);
  const auto channel = [&](double turn) {
    return brightness * (1 - vivid * (0.5 - 0.5 * std::cos(hue + 2 * kPi * turn)));
  };
  return {channel(0), channel(1.0 / 3), channel(2.0 / 3)};
}

Texture AnyTexture(Lots* lots) {
  constexpr Pattern kPatterns[] = {Pattern::kChecker, Pattern::kStripes, Pattern::kWood, Pattern::kDots,
                                   Pattern::kMosaic};
  return {kPatterns[lots->Below(5)], AnyColor(lots, 0.35), AnyColor(lots, 0.9),
          lots->Between(0.06, 0.12), lots->Seed(),         lots->Between(0, 0.7)};
}

Material AnyMaterial(Lots* lots) { return {AnyTexture(lots), lots->Between(0.05, 0.35), lots->Between(20, 60)}; }

struct Part {
  Body body;
  Motion motion = Motion::kSlides;
  double radius = 0.3;   // of its footprint around every place
  double height = 0;     // of what a part that turns is hinged to
  double heading = 0;    // radians about z
  bool upright = false;  // of a hinge
  Vec3 home;
  Track track;

  // Of three parameters, the place; of one that turns, the angle.
  Pose PoseAt(const State& state, size_t first) const {
    if (motion != Motion::kTurns) return {RotationZ(heading), {state[first], state[first + 1], state[first + 2]}};
    const Mat3 turn = upright ? RotationZ(-state[first]) : RotationX(-state[first]);
    return Pose{RotationZ(heading), home + Vec3{0, 0, height}} * Pose{turn, {}};
  }
};

// On the origin.
std::vector<Shape> AnySolid(Lots* lots) {
  const double width = lots->Between(0.17, 0.26), height = lots->Between(0.2, 0.5);
  const Material lower = AnyMaterial(lots), upper = AnyMaterial(lots);
  switch (lots->Below(4)) {
    case 0:  // a box with a ball on top
      return {Box({width, 0.8 * width, height / 2}, lower, {0, 0, height / 2}),
              Sphere(0.5 * width, upper, {0, 0, height + 0.4 * width})};
    case 1:  // a ball
      return {Sphere(1.1 * width, lower, {0, 0, 1.1 * width})};
    case 2:  // a drum with a lid
      return {Frustum(width, 0.85 * width, height, lower), Disk(0, 0.85 * width, upper, {0, 0, height})};
    default:  // a pawn
      return {Frustum(width, 0.35 * width, height, lower), Sphere(0.6 * width, upper, {0, 0, height + 0.4 * width})};
  }
}

// A slab along -y of its hinge, which lies along x, or along x of one that stands.
std::vector<Shape> AnySlab(Lots* lots, bool upright) {
  const double length = lots->Between(0.45, 0.7), width = lots->Between(0.2, 0.32), thick = lots->Between(0.03, 0.06);
  const Material panel = AnyMaterial(lots), knob = AnyMaterial(lots);
  if (upright) {
    return {Box({length / 2, thick, width}, panel, {length / 2, 0, width + 0.02}),
            Sphere(0.05, knob, {0.85 * length, -thick - 0.02, width})};
  }
  return {Box({width, length / 2, thick}, panel, {0, -length / 2, thick}),
          Sphere(0.05, knob, {0, -0.9 * length, 2 * thick + 0.02})};
}

bool Apart(const Vec3& place, double radius, const std::vector<Part>& others) {
  return std::all_of(others.begin(), others.end(), [&](const Part& other) {
    return std::all_of(other.track.begin(), other.track.end(), [&](const Keyframe& key) {
      const bool turns = other.motion == Motion::kTurns;
      const Vec3 there = turns ? other.home : Vec3{key.state[0], key.state[1], 0};
      const Vec3 way = Vec3{place.x, place.y, 0} - Vec3{there.x, there.y, 0};
      return Norm(way) > radius + other.radius + kGap;
    });
  });
}

Vec3 AnyPlace(Lots* lots, double radius, const std::vector<Part>& others) {
  Vec3 place;
  for (int i = 0; i < kTries; ++i) {
    place = {lots->Between(-kReach, kReach), lots->Between(-0.6 * kReach, 0.7 * kReach), 0};
    if (Apart(place, radius, others)) break;
  }
  return place;
}

// Another state of a part that is in `from`.
State AnyState(Lots* lots, const Part& part, const State& from, const std::vector<Part>& others) {
  if (part.motion == Motion::kTurns) return {from[0] > 0 && lots->Below(2) == 0 ? 0 : lots->Between(0.4, 1.7)};
  State state = from;
  for (int i = 0; i < kTries; ++i) {
    const double length = lots->Between(-0.8, 0.8);
    state = {part.home.x, part.home.y, 0};
    if (part.motion == Motion::kSlides) {
      state[0] += length * std::cos(part.heading), state[1] += length * std::sin(part.heading);
    } else if (part.motion == Motion::kRoams) {
      state[0] += length, state[1] += lots->Between(-0.5, 0.5);
    } else {
      state[2] = lots->Between(0, 0.7);
    }
    const bool inside = std::abs(state[0]) < 1.2 * kReach && std::abs(state[1]) < 0.8 * kReach;
    if (inside && StateDistance(state, from) > 0.3 && Apart({state[0], state[1], 0}, part.radius, others)) break;
  }
  return state;
}

Part AnyPart(Lots* lots, const std::vector<Part>& others) {
  Part part;
  part.motion = kMotions[lots->Below(4)];
  part.heading = lots->Between(-0.8, 0.8);
  part.upright = lots->Below(2) == 0;
  const bool turns = part.motion == Motion::kTurns;
  part.body.shapes = turns ? AnySlab(lots, part.upright) : AnySolid(lots);
  part.body.name = "part_" + std::to_string(others.size()) + "_" + kMotionNames[static_cast<int>(part.motion)];
  part.body.moves = true;
  part.radius = turns ? 0.45 : 0.3;
  part.height = turns && !part.upright ? lots->Between(0.1, 0.3) : 0;
  part.home = AnyPlace(lots, part.radius, others);
  State state = turns ? State{0} : State{part.home.x, part.home.y, 0};
  // Rests and ways by turns, of all lengths, the last of which ends with the clip.
  double time = lots->Between(0, 0.25);
  part.track = {{0, state}, {time, state}};
  while (time < 0.9) {
    state = AnyState(lots, part, state, others);
    time += lots->Between(0.07, 0.14);
    part.track.push_back({std::min(time, 1.0), state});
    time += lots->Between(0.02, 0.25);
    if (time < 1) part.track.push_back({time, state});
  }
  return part;
}

}  // namespace

Play MedleyPlay(uint64_t seed) {
  Lots lots(seed);
  std::vector<Part> parts;
  for (int left = 1 + lots.Below(3); left > 0; --left) parts.push_back(AnyPart(&lots, parts));
  Play play;
  play.bodies = {Studio(AnyColor(&lots, 0.5), AnyColor(&lots, 0.55)), Ball({-1.45, 0.5, 0}, 0.2, AnyTexture(&lots)),
                 Vase({0.2, 1.3, 0}, 0.2, 0.7, AnyTexture(&lots)),
                 Block({1.5, 0.4, 0}, {0.18, 0.14, 0.2}, lots.Between(0, 1.5), AnyTexture(&lots))};
  for (const Part& part : parts) {
    if (part.height > 0) {  // what a flap rests on
      play.bodies.push_back(Block(part.home, {0.25, 0.05, part.height / 2}, part.heading,
                                  {Pattern::kWood, {0.3, 0.2, 0.1}, {0.6, 0.4, 0.2}, 0.05, lots.Seed()}));
    }
    play.bodies.push_back(part.body);
    play.tracks.push_back(part.track);
  }
  play.poses = [parts](const State& state) {
    std::vector<Pose> poses;
    size_t first = 0;
    for (const Part& part : parts) {
      poses.push_back(part.PoseAt(state, first));
      first += part.track.front().state.size();
    }
    return poses;
  };
  play.camera.focus = {0, 0.05, 0.4};
  return play;
}

}  // namespace editnerf::synthetic
