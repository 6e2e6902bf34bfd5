#include "libeditnerf/editing/edit_trail.h"

#include <algorithm>
#include <cmath>

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

// One coordinate between values y1 and y2, `span` seconds apart.
double Hermite(double y1, double y2, double slope1, double slope2, double span, double x) {
  const double x2 = x * x, x3 = x2 * x;
  return (2 * x3 - 3 * x2 + 1) * y1 + (x3 - 2 * x2 + x) * span * slope1 + (3 * x2 - 2 * x3) * y2 +
         (x3 - x2) * span * slope2;
}

const Vec3& KeyPointOf(const TrailFrame& frame, size_t n) { return frame.key_points[n]; }
const Vec3& PositionOf(const TrailFrame& frame, size_t) { return frame.camera.position; }

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

Vec3 EditTrail::CurveAt(size_t before, double share, const Vec3& (*point)(const TrailFrame&, size_t),
                        size_t index) const {
  const auto secant = [&](size_t i, double Vec3::*axis) {  // of key frames i and i + 1
    return (point(frames_[i + 1], index).*axis - point(frames_[i], index).*axis) /
           (frames_[i + 1].time - frames_[i].time);
  };
  const auto slope = [&](size_t i, double Vec3::*axis) {  // at key frame i; the trail comes to rest at its ends
    if (i == 0 || i + 1 == frames_.size()) return 0.0;
    return MonotoneSlope(secant(i - 1, axis), frames_[i].time - frames_[i - 1].time, secant(i, axis),
                         frames_[i + 1].time - frames_[i].time);
  };
  const Vec3 &from = point(frames_[before], index), &to = point(frames_[before + 1], index);
  const double span = frames_[before + 1].time - frames_[before].time;
  const auto along = [&](double Vec3::*axis) {
    return Hermite(from.*axis, to.*axis, slope(before, axis), slope(before + 1, axis), span, share);
  };
  return {along(&Vec3::x), along(&Vec3::y), along(&Vec3::z)};
}

TrailFrame EditTrail::At(double seconds) const {
  if (frames_.empty()) Throw<DataError>("trail: there is no key frame");
  const double time = frames_.front().time + std::clamp(seconds, 0.0, Duration());
  const auto after = std::upper_bound(frames_.begin(), frames_.end(), time,
                                      [](double wanted, const TrailFrame& frame) { return wanted < frame.time; });
  if (after == frames_.end()) return frames_.back();
  const auto before = static_cast<size_t>(after - frames_.begin() - 1);
  TrailFrame found = frames_[before];
  const double share = (time - found.time) / (after->time - found.time);
  found.time = time;
  for (size_t n = 0; n < found.key_points.size(); ++n) found.key_points[n] = CurveAt(before, share, KeyPointOf, n);
  found.camera.position = CurveAt(before, share, PositionOf, 0);
  found.camera.orientation = BetweenRotations(found.camera.orientation, after->camera.orientation, share);
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
