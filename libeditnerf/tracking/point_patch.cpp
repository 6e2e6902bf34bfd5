#include "libeditnerf/tracking/point_patch.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "libeditnerf/tracking/patches.h"

namespace editnerf {
namespace {

constexpr double kRadius = 4;         // pixels at 320 wide
constexpr double kLeastGradient = 4;  // grey levels a pixel, squared, along the weaker direction
constexpr double kLeastShare = 0.05;  // of the stronger direction's
constexpr double kMostOff = 1.5;      // pixels at 320 wide
constexpr double kLeastSimilarity = 0.8;
constexpr double kLeastScale = 0.5, kMostScale = 2;  // of the patch's area
constexpr size_t kNeighbours = 10;
constexpr double kLeastFacing = 0.5;  // cosine
constexpr int kMostSteps = 12;
constexpr double kLastStep = 0.01;                                      // pixels
constexpr int kFewSteps = 3;                                            // from where it was aligned already
constexpr double kFirstTurn = 0.4, kLastTurn = 0.08, kMostSlope = 1.8;  // slopes of the surface against the view

size_t At(int64_t t) { return static_cast<size_t>(t); }

// To zero mean and unit length; returns the length that the values had.
double Normalise(std::vector<double>* values) {
  double mean = 0, length = 0;
  for (const double value : *values) mean += value / static_cast<double>(values->size());
  for (double& value : *values) value -= mean, length += value * value;
  length = std::sqrt(length);
  if (length > 0)
    for (double& value : *values) value /= length;
  return length;
}

const FlowTrack& Longest(const std::vector<FlowTrack>& tracks, const PartPoint& point) {
  return tracks[*std::max_element(point.tracks.begin(), point.tracks.end(),
                                  [&](size_t a, size_t b) { return tracks[a].pixel.size() < tracks[b].pixel.size(); })];
}

// A unit vector across the surface that the nearest points of the part make out, in the reference frame.
Vec3 NormalAt(const RigidPart& part, const Vec3& position) {
  std::vector<Eigen::Vector3d> others;
  for (const PartPoint& point : part.points) {
    const Vec3 offset = ToVec3(point.position) - position;
    others.emplace_back(offset.x, offset.y, offset.z);
  }
  const size_t count = std::min(others.size(), kNeighbours);
  const auto nearer = [](const auto& a, const auto& b) { return a.squaredNorm() < b.squaredNorm(); };
  std::partial_sort(others.begin(), others.begin() + static_cast<int64_t>(count), others.end(), nearer);
  others.resize(count);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& other : others) mean += other / static_cast<double>(count);
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& other : others) spread += (other - mean) * (other - mean).transpose();
  const Eigen::Vector3d normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  return {normal.x(), normal.y(), normal.z()};
}

}  // namespace

PointPatch::PointPatch(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                       const PartPoint& point)
    : position_(ToVec3(point.position)), normal_(NormalAt(part, position_)) {
  const FlowTrack& longest = Longest(tracks, point);
  frame_ = (longest.first + longest.end()) / 2;
  center_ = longest.At(frame_);
  const GreyImage image(clip.gray[At(frame_)]);
  const auto radius = static_cast<int64_t>(std::lround(std::max(3.0, kRadius * clip.PixelScale())));
  for (int64_t dv = -radius; dv <= radius; ++dv) {
    for (int64_t du = -radius; du <= radius; ++du) {
      const auto u = static_cast<double>(du), v = static_cast<double>(dv);
      const auto grey = [&](double by_u, double by_v) {
        return image.At({center_.u + u + by_u, center_.v + v + by_v});
      };
      offset_.push_back({u, v});
      value_.push_back(grey(0, 0));
      gradient_.push_back({(grey(1, 0) - grey(-1, 0)) / 2, (grey(0, 1) - grey(0, -1)) / 2});
    }
  }
  deviation_ = Normalise(&value_);
}

bool PointPatch::HasCorner() const {
  double uu = 0, uv = 0, vv = 0;
  for (const Pixel& g : gradient_) uu += g.u * g.u, uv += g.u * g.v, vv += g.v * g.v;
  const double mean = (uu + vv) / 2, spread = std::hypot((uu - vv) / 2, uv);
  return mean - spread >
         std::max(kLeastGradient * static_cast<double>(gradient_.size()), kLeastShare * (mean + spread));
}

// The surroundings of the point as a plane across its normal.
PatchWarp PointPatch::WarpTo(const Clip& clip, const RigidPart& part, int64_t t) const {
  const Camera& camera = clip.cameras[At(frame_)];
  const Vec3 place = part.Place(frame_, position_), axis = camera.orientation.Row(2);
  const double per_pixel = Dot(place - camera.position, axis) / camera.focal_length;
  Vec3 across = part.Place(frame_, position_ + normal_) - place;
  if (Dot(across, axis) > 0) across = -across;
  // Seen at a grazing angle a plane made of few points tells nothing.
  const double towards = std::min(Dot(across, axis), -kLeastFacing);
  const auto step = [&](const Vec3& along) { return (along - axis * (Dot(across, along) / towards)) * per_pixel; };
  const auto seen = [&](const Vec3& at) {
    return Project(clip.cameras[At(t)], part.Place(t, part.TakeBack(frame_, at)));
  };
  const Projected center = seen(place), right = seen(place + step(camera.orientation.Row(0))),
                  down = seen(place + step(camera.orientation.Row(1)));
  if (!center.valid || !right.valid || !down.valid) return {0, 0, 0, 0};
  return {right.u - center.u, down.u - center.u, right.v - center.v, down.v - center.v};
}

bool PointPatch::IsComparable(const PatchWarp& warp) {
  const double area = std::abs(warp.Determinant());
  return area >= kLeastScale && area <= kMostScale;
}

// Mean correlation with what was seen.
double PointPatch::Likeness(const Clip& clip, const RigidPart& part, const std::vector<Sighting>& seen) const {
  double sum = 0;
  for (const Sighting& one : seen) {
    const PatchWarp warp = WarpTo(clip, part, one.frame);
    Pixel at = one.pixel;
    if (IsComparable(warp)) sum += Align(clip.gray[At(one.frame)], warp, kFewSteps, &at);
  }
  return sum / static_cast<double>(seen.size());
}

void PointPatch::FitNormal(const Clip& clip, const RigidPart& part, const std::vector<Sighting>& seen) {
  const Vec3 towards = Normalized(part.TakeBack(frame_, clip.cameras[At(frame_)].position) - position_);
  const Vec3 right = Normalized(Cross(towards, std::abs(towards.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const Vec3 up = Cross(towards, right);
  const double facing = Dot(normal_, towards);
  const double along = facing < 0 ? std::min(facing, -kLeastFacing) : std::max(facing, kLeastFacing);
  double slope_u = Dot(normal_, right) / along, slope_v = Dot(normal_, up) / along;
  const auto likeness = [&](double u, double v) {
    if (std::hypot(u, v) > kMostSlope) return -1.0;
    normal_ = Normalized(towards + right * u + up * v);
    return Likeness(clip, part, seen);
  };
  double best = likeness(slope_u, slope_v);
  for (double step = kFirstTurn; step > kLastTurn;) {
    bool better = false;
    for (const auto& [du, dv] : {std::pair{step, 0.0}, {-step, 0.0}, {0.0, step}, {0.0, -step}}) {
      const double now = likeness(slope_u + du, slope_v + dv);
      better = now > best;
      if (!better) continue;
      best = now, slope_u += du, slope_v += dv;
      break;
    }
    if (!better) step /= 2;
  }
  normal_ = Normalized(towards + right * slope_u + up * slope_v);
}

bool PointPatch::Find(const Clip& clip, int64_t t, const PatchWarp& warp, Pixel* at) const {
  const Pixel from = *at;
  return Align(clip.gray[At(t)], warp, kMostSteps, at) >= kLeastSimilarity && clip.Inside(*at) &&
         Distance(*at, from) <= kMostOff * clip.PixelScale();
}

// Moves `at` to where the frame looks like the template, and returns the correlation there; 0 where it gets lost.
double PointPatch::Align(const torch::Tensor& gray, const PatchWarp& warp, int most_steps, Pixel* at) const {
  // Gradients of the template as they would be in the frame.
  const double determinant = warp.uu * warp.vv - warp.uv * warp.vu;
  const auto carried = [&](const Pixel& g) {
    return Pixel{(warp.vv * g.u - warp.vu * g.v) / determinant, (warp.uu * g.v - warp.uv * g.u) / determinant};
  };
  double uu = 0, uv = 0, vv = 0;
  for (const Pixel& of_template : gradient_) {
    const Pixel g = carried(of_template);
    uu += g.u * g.u, uv += g.u * g.v, vv += g.v * g.v;
  }
  const double scale = uu * vv - uv * uv;
  if (!(scale > 0)) return 0;
  const GreyImage image(gray);
  std::vector<double> now(value_.size());
  for (int step = 0;; ++step) {
    for (size_t i = 0; i < now.size(); ++i) {
      const Pixel by = warp(offset_[i].u, offset_[i].v);
      now[i] = image.At({at->u + by.u, at->v + by.v});
    }
    if (!(Normalise(&now) > 0)) return 0;
    double right_u = 0, right_v = 0, similarity = 0;
    for (size_t i = 0; i < now.size(); ++i) {
      const Pixel g = carried(gradient_[i]);
      const double miss = deviation_ * (value_[i] - now[i]);
      right_u += g.u * miss, right_v += g.v * miss;
      similarity += value_[i] * now[i];
    }
    const Pixel by = {(vv * right_u - uv * right_v) / scale, (uu * right_v - uv * right_u) / scale};
    if (std::hypot(by.u, by.v) < kLastStep || step == most_steps) return similarity;
    *at = {at->u + by.u, at->v + by.v};
  }
}

}  // namespace editnerf
