#include "libeditnerf/editing/edit_trail.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/editing/orbit_camera.h"
#include "libeditnerf/imaging/camera_file.h"

namespace editnerf {
namespace {

// The slope of a monotone cubic at the point between two secants, which span `left` and `right` seconds: their weighted
// harmonic mean, and 0 where they differ in sign.
double MonotoneSlope(double left_secant, double left, double right_secant, double right) {
  if (!(left_secant * right_secant > 0)) return 0;
  const double a = 2 * right + left, b = right + 2 * left;
  return (a + b) / (a / left_secant + b / right_secant);
}

Vec3 MonotoneSlope(const Vec3& left_secant, double left, const Vec3& right_secant, double right) {
  return {MonotoneSlope(left_secant.x, left, right_secant.x, right),
          MonotoneSlope(left_secant.y, left, right_secant.y, right),
          MonotoneSlope(left_secant.z, left, right_secant.z, right)};
}

// Between values y1 and y2, `span` seconds apart.
Vec3 Hermite(const Vec3& y1, const Vec3& y2, const Vec3& slope1, const Vec3& slope2, double span, double x) {
  const double x2 = x * x, x3 = x2 * x;
  return (2 * x3 - 3 * x2 + 1) * y1 + (x3 - 2 * x2 + x) * span * slope1 + (3 * x2 - 2 * x3) * y2 +
         (x3 - x2) * span * slope2;
}

// The rotation vector (axis times angle, at most half a turn) of a rotation.
Vec3 RotationVector(const Mat3& turn) {
  Vec3 axis = {turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)};  // times 2 sin(angle)
  const double cosine = (turn(0, 0) + turn(1, 1) + turn(2, 2) - 1) / 2, sine = Norm(axis) / 2;
  if (sine < 1e-9) {
    if (cosine > 0) return axis / 2;
    // Half a turn: the axis is the largest column of turn + 1.
    for (int i = 0; i < 3; ++i) {
      const Vec3 column = {turn(0, i) + (i == 0), turn(1, i) + (i == 1), turn(2, i) + (i == 2)};
      if (Norm(column) > Norm(axis)) axis = column;
    }
  }
  return Normalized(axis) * std::atan2(sine, cosine);
}

Mat3 Rotated(const Mat3& orientation, const Vec3& rotation_vector) {
  const double angle = Norm(rotation_vector);
  return angle > 0 ? RotationAround(rotation_vector / angle, angle) * orientation : orientation;
}

// Between orientations, `span` seconds apart, with angular velocities turn1 and turn2 there, in the camera's axes: a
// cubic Bezier curve of rotations (Shoemake, 1985).
Mat3 BezierRotation(const Mat3& r1, const Mat3& r2, const Vec3& turn1, const Vec3& turn2, double span, double x) {
  const Mat3 b1 = Rotated(r1, turn1 * (span / 3)), b2 = Rotated(r2, turn2 * (-span / 3));
  const Mat3 middle = BetweenRotations(b1, b2, x);
  return BetweenRotations(BetweenRotations(BetweenRotations(r1, b1, x), middle, x),
                          BetweenRotations(middle, BetweenRotations(b2, r2, x), x), x);
}

Vec3 SeenFrom(const Camera& camera, const Vec3& point) { return camera.orientation * (point - camera.position); }

// What two cameras turn around: the point where their optical axes meet. Where they only almost do and the one camera
// becomes the other by a turn around a line that both see, such as that of an orbit around something beside the middle
// of the picture, it lies on that line. Nothing where there is no such point at a sensible distance in front of both.
std::optional<Vec3> TargetOf(const Camera& a, const Camera& b) {
  constexpr double kLeastSine = 0.017;  // of the angle between the axes: on a smaller turn a chord is as good
  constexpr double kMeet = 1e-6, kAlmostMeet = 0.1;  // of the distance
  constexpr double kNearest = 0.1;                   // of the way between the cameras
  const Vec3 za = a.orientation.Row(2), zb = b.orientation.Row(2), way = b.position - a.position;
  const Vec3 normal = Cross(za, zb);
  const double sine2 = Dot(normal, normal);
  if (!(sine2 >= kLeastSine * kLeastSine)) return std::nullopt;
  // The nearest points of the two axes.
  const double to_a = Dot(Cross(way, zb), normal) / sine2, to_b = Dot(Cross(way, za), normal) / sine2;
  const Vec3 on_a = a.position + za * to_a, on_b = b.position + zb * to_b, meeting = (on_a + on_b) * 0.5;
  const double gap = Norm(on_a - on_b), distance = std::min(to_a, to_b);
  const bool in_front = distance > kNearest * Norm(way);
  if (in_front && gap <= kMeet * distance) return meeting;

  const Vec3 turn = a.orientation.Transposed() * -RotationVector(b.orientation * a.orientation.Transposed());
  const double angle = Norm(turn), slide = Dot(turn, way) / angle;  // along the line
  const Vec3 line = turn / angle;
  Vec3 target = (a.position + b.position) * 0.5 + Cross(line, way) / (2 * std::tan(angle / 2));
  target += line * Dot(line, meeting - target);
  const auto sees = [&](const Camera& camera) {
    const Vec3 seen = SeenFrom(camera, target);
    return seen.z > kNearest * Norm(way) && std::hypot(seen.x, seen.y) <= seen.z;
  };
  if (std::abs(slide) <= kMeet * Norm(way) && sees(a) && sees(b)) return target;
  if (in_front && gap <= kAlmostMeet * distance) return meeting;
  return std::nullopt;
}

// Of a key frame, per second. The angular velocity is in the camera's axes.
struct CameraVelocity {
  Vec3 turn, move;
};

// The key frames of a trail and what follows from their neighbours.
class TrailCurve {
 public:
  explicit TrailCurve(const std::vector<TrailFrame>& frames) : frames_(frames) {}

  double Span(size_t i) const { return frames_[i + 1].time - frames_[i].time; }  // of key frames i and i + 1

  // Of point(frame) at key frame i; the trail comes to rest at its ends.
  template <class Point>
  Vec3 Slope(size_t i, const Point& point) const {
    if (IsEnd(i)) return {};
    const Vec3 before = point(frames_[i - 1]), here = point(frames_[i]), after = point(frames_[i + 1]);
    return MonotoneSlope((here - before) / Span(i - 1), Span(i - 1), (after - here) / Span(i), Span(i));
  }

  template <class Point>
  Vec3 Between(size_t i, double share, const Point& point) const {
    return Hermite(point(frames_[i]), point(frames_[i + 1]), Slope(i, point), Slope(i + 1, point), Span(i), share);
  }

  // Position and orientation between key frames i and i + 1.
  void PlaceCamera(size_t i, double share, Camera* camera) const {
    const Camera &a = frames_[i].camera, &b = frames_[i + 1].camera;
    const CameraVelocity va = VelocityAt(i), vb = VelocityAt(i + 1);
    camera->orientation = BezierRotation(a.orientation, b.orientation, va.turn, vb.turn, Span(i), share);
    if (const auto target = Target(i)) {
      const auto slope = [&](const Camera& at, const CameraVelocity& velocity) {
        return Cross(velocity.turn, SeenFrom(at, *target)) - at.orientation * velocity.move;
      };
      const Vec3 seen = Hermite(SeenFrom(a, *target), SeenFrom(b, *target), slope(a, va), slope(b, vb), Span(i), share);
      camera->position = *target - camera->orientation.Transposed() * seen;
    } else {
      camera->position = Hermite(a.position, b.position, va.move, vb.move, Span(i), share);
    }
  }

 private:
  bool IsEnd(size_t i) const { return i == 0 || i + 1 == frames_.size(); }

  std::optional<Vec3> Target(size_t i) const { return TargetOf(frames_[i].camera, frames_[i + 1].camera); }

  Vec3 TurnSecant(size_t i) const {
    return RotationVector(frames_[i + 1].camera.orientation * frames_[i].camera.orientation.Transposed()) / Span(i);
  }

  // The camera moves as it must for the targets around key frame i to stay where they are in the picture.
  CameraVelocity VelocityAt(size_t i) const {
    if (IsEnd(i)) return {};
    const Camera& camera = frames_[i].camera;
    CameraVelocity velocity;
    velocity.turn = MonotoneSlope(TurnSecant(i - 1), Span(i - 1), TurnSecant(i), Span(i));
    int targets = 0;
    for (const size_t side : {i - 1, i}) {
      const auto target = Target(side);
      if (!target) continue;
      const Vec3 slope = Slope(i, [&](const TrailFrame& frame) { return SeenFrom(frame.camera, *target); });
      velocity.move += camera.orientation.Transposed() * (Cross(velocity.turn, SeenFrom(camera, *target)) - slope);
      ++targets;
    }
    if (targets == 0) {
      velocity.move = Slope(i, [](const TrailFrame& frame) { return frame.camera.position; });
    } else {
      velocity.move = velocity.move / targets;
    }
    return velocity;
  }

  const std::vector<TrailFrame>& frames_;
};

}  // namespace

void EditTrail::Add(const TrailFrame& frame) {
  if (!std::isfinite(frame.time)) Throw<DataError>("trail: expected a time in seconds, found {}", frame.time);
  if (!frames_.empty()) {
    if (frame.time < frames_.back().time) {
      Throw<DataError>("trail: expected a time of at least {:.3f} s, where its last key frame is, found {:.3f} s",
                       frames_.back().time, frame.time);
    }
    if (frame.time == frames_.back().time) {
      frames_.back() = frame;
      return;
    }
    if (frame.time - frames_.front().time > kMaxSeconds) {
      Throw<DataError>("trail: expected at most {} s; clear it, or end it earlier", kMaxSeconds);
    }
    if (frames_.size() >= kMaxFrames) Throw<DataError>("trail: it is full with {} key frames; clear it", kMaxFrames);
  }
  frames_.push_back(frame);
}

size_t EditTrail::Index(int64_t index) const {
  const auto count = static_cast<int64_t>(frames_.size());
  if (index < 0 || index >= count) {
    Throw<DataError>("key frame {}: the trail has {}{}", index, count, count > 0 ? ", numbered from 0" : "");
  }
  return static_cast<size_t>(index);
}

void EditTrail::BeginAt(double time) {
  if (frames_.empty()) return;
  const double shift = time - frames_.front().time;
  for (TrailFrame& frame : frames_) frame.time += shift;
}

void EditTrail::Replace(int64_t index, const TrailFrame& frame) {
  TrailFrame& replaced = frames_[Index(index)];
  const double time = replaced.time;
  replaced = frame;
  replaced.time = time;
}

void EditTrail::Move(int64_t index, double seconds) {
  const size_t moved = Index(index);
  if (!(seconds >= 0 && seconds <= kMaxSeconds)) {
    Throw<DataError>("trail: expected a time of 0 to {} s, found {}", kMaxSeconds, seconds);
  }
  const double start = frames_.front().time, time = start + seconds;
  for (size_t i = 0; i < frames_.size(); ++i) {
    if (i != moved && frames_[i].time == time) Throw<DataError>("trail: there is a key frame at {} s already", seconds);
  }
  frames_[moved].time = time;
  std::sort(frames_.begin(), frames_.end(), [](const TrailFrame& a, const TrailFrame& b) { return a.time < b.time; });
  BeginAt(start);
}

void EditTrail::Remove(int64_t index) {
  const size_t removed = Index(index);
  const double start = frames_.front().time;
  frames_.erase(frames_.begin() + static_cast<std::ptrdiff_t>(removed));
  BeginAt(start);
}

TrailFrame EditTrail::At(double seconds) const {
  if (frames_.empty()) Throw<DataError>("trail: there is no key frame");
  const double time = frames_.front().time + std::clamp(seconds, 0.0, Duration());
  const auto after = std::upper_bound(frames_.begin(), frames_.end(), time,
                                      [](double wanted, const TrailFrame& frame) { return wanted < frame.time; });
  if (after == frames_.end()) return frames_.back();
  const auto before = static_cast<size_t>(after - frames_.begin() - 1);
  TrailFrame found = frames_[before];
  if (time == found.time) return found;
  const TrailCurve curve(frames_);
  const double share = (time - found.time) / curve.Span(before);
  found.time = time;
  for (size_t n = 0; n < found.key_points.size(); ++n) {
    found.key_points[n] = curve.Between(before, share, [n](const TrailFrame& frame) { return frame.key_points[n]; });
  }
  curve.PlaceCamera(before, share, &found.camera);
  return found;
}

EditFile EditTrail::ToEditFile(const Scene& scene, double fps, int64_t width, int64_t height) const {
  if (frames_.empty()) Throw<DataError>("trail: there is no key frame; record a drag, or add one");
  if (!(fps > 0 && fps <= 120)) {
    Throw<DataError>("trail: fps: expected a rate above 0 and up to 120, found {}", fps);
  }
  EditFile edit;
  edit.fps = fps;
  edit.width = width;
  edit.height = height;
  const int64_t count = std::llround(Duration() * fps) + 1;
  for (int64_t i = 0; i < count; ++i) {
    const TrailFrame at = At(static_cast<double>(i) / fps);
    EditFrame frame;
    frame.key_points.assign(at.key_points.begin(), at.key_points.end());
    frame.camera = CameraInWorldUnits(at.camera, scene.transform);
    frame.code_frame = scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(at.row)])].id;
    edit.frames.push_back(std::move(frame));
  }
  return edit;
}

}  // namespace editnerf
