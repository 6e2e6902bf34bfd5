#include "libeditnerf/poses/scene_bounds.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/percentile.h"

namespace editnerf {
namespace {

constexpr double kOutlierShare = 0.025;  // of the points, at both ends of each axis
constexpr double kDistanceShare = 0.01;  // of a camera's points, at both ends
constexpr double kNearMargin = 0.7, kFarMargin = 1.2;
constexpr size_t kMinSeenPoints = 8;  // fewer say nothing about a frame

class Box {
 public:
  void Add(const Vec3& point) {
    const double p[3] = {point.x, point.y, point.z};
    for (int axis = 0; axis < 3; ++axis) {
      low_[axis] = std::min(low_[axis], p[axis]);
      high_[axis] = std::max(high_[axis], p[axis]);
    }
  }
  Vec3 Middle() const { return {(low_[0] + high_[0]) / 2, (low_[1] + high_[1]) / 2, (low_[2] + high_[2]) / 2}; }
  double Diagonal() const { return Norm(Vec3{high_[0] - low_[0], high_[1] - low_[1], high_[2] - low_[2]}); }

 private:
  double low_[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high_[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
};

Vec3 PointAt(const torch::Tensor& points, int64_t row) {
  const double* p = points.data_ptr<double>() + 3 * row;
  return {p[0], p[1], p[2]};
}

// World-unit near and far over all frames; false where no frame saw enough points.
bool BoundsFromPoints(const ImportedModel& model, double* near, double* far) {
  std::vector<double> nears, fars;
  for (const ImportedFrame& frame : model.frames) {
    std::vector<double> distances;
    for (const int64_t row : frame.seen_points)
      distances.push_back(Norm(PointAt(model.points, row) - frame.camera.position));
    if (distances.size() < kMinSeenPoints) continue;
    nears.push_back(Percentile(distances, kDistanceShare));
    fars.push_back(Percentile(distances, 1 - kDistanceShare));
  }
  if (nears.empty()) return false;
  *near = kNearMargin * Percentile(nears, kDistanceShare);
  *far = kFarMargin * Percentile(fars, 1 - kDistanceShare);
  return true;
}

void AddPoints(const torch::Tensor& points, Box* box) {
  Vec3 low, high;
  double* bounds[2][3] = {{&low.x, &low.y, &low.z}, {&high.x, &high.y, &high.z}};
  for (int64_t axis = 0; axis < 3; ++axis) {
    const torch::Tensor column = points.select(1, axis).contiguous();
    std::vector<double> values(column.data_ptr<double>(), column.data_ptr<double>() + column.numel());
    *bounds[0][axis] = Percentile(values, kOutlierShare);
    *bounds[1][axis] = Percentile(values, 1 - kOutlierShare);
  }
  box->Add(low);
  box->Add(high);
}

// The point nearest to all optical axes in the least-squares sense; false where the axes are (nearly) parallel.
bool LookedAtPoint(const ImportedModel& model, Vec3* point) {
  Mat3 a = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};
  Vec3 b;
  for (const ImportedFrame& frame : model.frames) {
    const Vec3 d = frame.camera.orientation.Row(2);
    const double v[3] = {d.x, d.y, d.z};
    Mat3 projector;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) projector(r, c) -= v[r] * v[c];
    for (size_t i = 0; i < 9; ++i) a.m[i] += projector.m[i];
    b += projector * frame.camera.position;
  }
  const auto determinant = [](const Mat3& m) { return Dot(m.Row(0), Cross(m.Row(1), m.Row(2))); };
  const double det = determinant(a);
  const auto count = static_cast<double>(model.frames.size());
  if (!(det > 1e-4 * count * count * count)) return false;
  double solution[3];
  const double right[3] = {b.x, b.y, b.z};
  for (int column = 0; column < 3; ++column) {  // Cramer's rule
    Mat3 replaced = a;
    for (int r = 0; r < 3; ++r) replaced(r, column) = right[r];
    solution[column] = determinant(replaced) / det;
  }
  *point = {solution[0], solution[1], solution[2]};
  return true;
}

void AddFrustumEnd(const ImportedFrame& frame, Box* box) {
  const auto width = static_cast<double>(frame.camera.width), height = static_cast<double>(frame.camera.height);
  for (const double u : {0.0, width}) {
    for (const double v : {0.0, height})
      box->Add(frame.camera.position + frame.camera.DirectionThrough(u, v) * frame.far);
  }
}

}  // namespace

SceneTransform EstimateSceneTransform(const ImportedModel& model) {
  if (model.frames.empty()) Throw<DataError>("expected at least one camera to place a scene");
  Box box;
  for (const ImportedFrame& frame : model.frames) box.Add(frame.camera.position);
  double near = 0, far = 0;
  Vec3 target;
  const bool bounded = std::all_of(model.frames.begin(), model.frames.end(),
                                   [](const ImportedFrame& frame) { return frame.near > 0 && frame.far > frame.near; });
  if (model.points.defined() && model.points.size(0) > 0 && BoundsFromPoints(model, &near, &far)) {
    AddPoints(model.points, &box);
  } else if (bounded) {
    near = HUGE_VAL;
    for (const ImportedFrame& frame : model.frames) {
      near = std::min(near, 0.9 * frame.near);
      far = std::max(far, 1.1 * frame.far);
      AddFrustumEnd(frame, &box);
    }
  } else if (LookedAtPoint(model, &target)) {
    near = HUGE_VAL;
    for (const ImportedFrame& frame : model.frames) {
      const double distance = Norm(frame.camera.position - target);
      near = std::min(near, 0.25 * distance);
      far = std::max(far, 2 * distance);
    }
    box.Add(target);
  } else {
    Throw<DataError>(
        "the source has neither points nor depth bounds, and its cameras do not look at one place; give a COLMAP "
        "model");
  }
  SceneTransform transform;
  transform.center = box.Middle();
  const double diagonal = box.Diagonal();
  if (!(diagonal > 0) || !std::isfinite(diagonal) || !(near > 0 && near < far)) {
    Throw<DataError>(
        "the cameras and points do not determine the size of the scene (extent {:.3g}, near {:.3g}, far {:.3g})",
        diagonal, near, far);
  }
  transform.scale = 1 / diagonal;
  transform.near = near * transform.scale;
  transform.far = far * transform.scale;
  return transform;
}

}  // namespace editnerf
