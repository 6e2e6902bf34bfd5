#include "libeditnerf/tracking/part_alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "libeditnerf/tracking/patches.h"

namespace editnerf {
namespace {

constexpr double kRadius = 4;         // pixels at 320 wide
constexpr double kLeastGradient = 4;  // grey levels a pixel, squared, along the weaker direction
constexpr double kLeastShare = 0.05;  // of the stronger direction's
constexpr double kMostOff = 1.5;      // pixels at 320 wide, from where the frame beside it says that it is
constexpr double kLeastSimilarity = 0.8;
constexpr double kLeastScale = 0.5, kMostScale = 2;  // of the patch's area
constexpr size_t kNeighbours = 10;
constexpr double kLeastFacing = 0.5;  // cosine
constexpr int kMostSteps = 12;
constexpr double kLastStep = 0.01;  // pixels

size_t At(int64_t t) { return static_cast<size_t>(t); }

// A 2 x 2 matrix, from pixels of the template to those of a frame.
struct Warp {
  double uu = 1, uv = 0, vu = 0, vv = 1;

  double Area() const { return std::abs(uu * vv - uv * vu); }
  Pixel operator()(double du, double dv) const { return {uu * du + uv * dv, vu * du + vv * dv}; }
};

// What one frame shows around a pixel, with zero mean and unit length, and its gradient.
class Template {
 public:
  Template(const torch::Tensor& gray, const Pixel& center, int64_t radius) {
    for (int64_t dv = -radius; dv <= radius; ++dv) {
      for (int64_t du = -radius; du <= radius; ++du) {
        const auto u = static_cast<double>(du), v = static_cast<double>(dv);
        const auto grey = [&](double by_u, double by_v) {
          return GreyAt(gray, {center.u + u + by_u, center.v + v + by_v});
        };
        offset_.push_back({u, v});
        value_.push_back(grey(0, 0));
        gradient_.push_back({(grey(1, 0) - grey(-1, 0)) / 2, (grey(0, 1) - grey(0, -1)) / 2});
      }
    }
    deviation_ = Normalise(&value_);
  }

  bool HasCorner() const {
    double uu = 0, uv = 0, vv = 0;
    for (const Pixel& g : gradient_) uu += g.u * g.u, uv += g.u * g.v, vv += g.v * g.v;
    const double mean = (uu + vv) / 2, spread = std::hypot((uu - vv) / 2, uv);
    return mean - spread >
           std::max(kLeastGradient * static_cast<double>(gradient_.size()), kLeastShare * (mean + spread));
  }

  // Moves `at` to where the frame looks like the template, and returns the correlation there; 0 where it gets lost.
  double Align(const torch::Tensor& gray, const Warp& warp, Pixel* at) const {
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
    std::vector<double> now(value_.size());
    for (int step = 0;; ++step) {
      for (size_t i = 0; i < now.size(); ++i) {
        const Pixel by = warp(offset_[i].u, offset_[i].v);
        now[i] = GreyAt(gray, {at->u + by.u, at->v + by.v});
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
      if (std::hypot(by.u, by.v) < kLastStep || step == kMostSteps) return similarity;
      *at = {at->u + by.u, at->v + by.v};
    }
  }

 private:
  // Returns the length that the values had.
  static double Normalise(std::vector<double>* values) {
    double mean = 0, length = 0;
    for (const double value : *values) mean += value / static_cast<double>(values->size());
    for (double& value : *values) value -= mean, length += value * value;
    length = std::sqrt(length);
    if (length > 0)
      for (double& value : *values) value /= length;
    return length;
  }

  std::vector<Pixel> offset_, gradient_;
  std::vector<double> value_;
  double deviation_ = 0;  // length of the values before they were normalised
};

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

// How the surroundings of a point, a plane across `normal`, come from frame `from` to frame `to`.
Warp CarriedBy(const Clip& clip, const RigidPart& part, const Vec3& position, const Vec3& normal, int64_t from,
               int64_t to) {
  const Camera& camera = clip.cameras[At(from)];
  const Vec3 place = part.Place(from, position), axis = camera.orientation.Row(2);
  const double per_pixel = Dot(place - camera.position, axis) / camera.focal_length;
  Vec3 across = part.Place(from, position + normal) - place;
  if (Dot(across, axis) > 0) across = -across;
  // Seen at a grazing angle a plane made of few points tells nothing.
  const double towards = std::min(Dot(across, axis), -kLeastFacing);
  const auto step = [&](const Vec3& along) { return (along - axis * (Dot(across, along) / towards)) * per_pixel; };
  const auto seen = [&](const Vec3& at) {
    return Project(clip.cameras[At(to)], part.Place(to, part.TakeBack(from, at)));
  };
  const Projected center = seen(place), right = seen(place + step(camera.orientation.Row(0))),
                  down = seen(place + step(camera.orientation.Row(1)));
  if (!center.valid || !right.valid || !down.valid) return {0, 0, 0, 0};
  return {right.u - center.u, down.u - center.u, right.v - center.v, down.v - center.v};
}

}  // namespace

std::vector<FlowTrack> AlignPoint(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                                  const PartPoint& point) {
  const FlowTrack& longest =
      tracks[*std::max_element(point.tracks.begin(), point.tracks.end(),
                               [&](size_t a, size_t b) { return tracks[a].pixel.size() < tracks[b].pixel.size(); })];
  const int64_t from = (longest.first + longest.end()) / 2;
  const auto radius = static_cast<int64_t>(std::lround(std::max(3.0, kRadius * clip.PixelScale())));
  const Template patch(clip.gray[At(from)], longest.At(from), radius);
  if (!patch.HasCorner()) return {};
  const Vec3 position = ToVec3(point.position), normal = NormalAt(part, position);
  std::vector<Pixel> at(At(clip.num_frames()));
  std::vector<bool> found(at.size(), false);
  at[At(from)] = longest.At(from);
  found[At(from)] = true;
  for (const int64_t step : {-1, 1}) {
    const Projected start = Project(clip.cameras[At(from)], part.Place(from, position));
    Pixel off = {longest.At(from).u - start.u,
                 longest.At(from).v - start.v};  // of the image from the part, as last found
    for (int64_t t = from + step; t >= 0 && t < clip.num_frames(); t += step) {
      const Projected expected = Project(clip.cameras[At(t)], part.Place(t, position));
      const Warp warp = CarriedBy(clip, part, position, normal, from, t);
      if (!part.seen[At(t)] || !expected.valid || warp.Area() < kLeastScale || warp.Area() > kMostScale) continue;
      const Pixel guess = {expected.u + off.u, expected.v + off.v};
      Pixel there = guess;
      if (patch.Align(clip.gray[At(t)], warp, &there) < kLeastSimilarity || !clip.Inside(there) ||
          Distance(there, guess) > kMostOff * clip.PixelScale()) {
        continue;
      }
      off = {there.u - expected.u, there.v - expected.v};
      at[At(t)] = there;
      found[At(t)] = true;
    }
  }
  std::vector<FlowTrack> runs;
  for (int64_t t = 0; t < clip.num_frames(); ++t) {
    if (!found[At(t)]) continue;
    if (t == 0 || !found[At(t - 1)]) runs.push_back({t, t, {}, false});
    runs.back().pixel.push_back(at[At(t)]);
  }
  std::stable_sort(runs.begin(), runs.end(),
                   [](const FlowTrack& a, const FlowTrack& b) { return a.pixel.size() > b.pixel.size(); });
  return runs;
}

}  // namespace editnerf
