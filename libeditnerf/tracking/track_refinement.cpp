#include "libeditnerf/tracking/track_refinement.h"

#include <ceres/ceres.h>
#include <ceres/cubic_interpolation.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "libeditnerf/base/percentile.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/cost_terms.h"

namespace editnerf {
namespace {

using FlowGrid = ceres::Grid2D<float, 2>;
using FlowInterpolator = ceres::BiCubicInterpolator<FlowGrid>;

constexpr double kRobustScale = 2;  // standard deviations from which a term counts as an outlier

size_t At(int64_t t) { return static_cast<size_t>(t); }

struct MotionTerm {
  const Camera& camera;
  const Camera& next_camera;
  const FlowInterpolator& flow;
  double weight;

  template <class T>
  bool operator()(const T* point, const T* next_point, T* residual) const {
    T pixel[2], next_pixel[2], displacement[2];
    if (!ProjectPoint(camera, point, pixel) || !ProjectPoint(next_camera, next_point, next_pixel)) return false;
    flow.Evaluate(pixel[1] - T(0.5), pixel[0] - T(0.5), displacement);
    for (int i = 0; i < 2; ++i) residual[i] = T(weight) * (next_pixel[i] - pixel[i] - displacement[i]);
    return true;
  }
};

struct GeometryTerm {
  Vec3 center;
  double distance, weight;

  template <class T>
  bool operator()(const T* point, T* residual) const {
    const T x = point[0] - T(center.x), y = point[1] - T(center.y), z = point[2] - T(center.z);
    const T squared = x * x + y * y + z * z;
    if (!(squared > T(1e-12))) return false;
    using std::sqrt;
    residual[0] = T(weight) * (sqrt(squared) - T(distance));
    return true;
  }
};

struct SkipTerm {
  const Camera& camera;
  Pixel pixel;
  double weight;

  template <class T>
  bool operator()(const T* point, T* residual) const {
    T projected[2];
    if (!ProjectPoint(camera, point, projected)) return false;
    residual[0] = T(weight) * (projected[0] - T(pixel.u));
    residual[1] = T(weight) * (projected[1] - T(pixel.v));
    return true;
  }
};

class Refiner {
 public:
  Refiner(const Clip& clip, const PointTrack& initial, const PixelTrack& pixels, const RefinementOptions& options)
      : clip_(clip), initial_(initial), pixels_(pixels), options_(options), distance_(pixels.distance) {
    for (const Vec3& p : initial.position) positions_.push_back({p.x, p.y, p.z});
    const int64_t frames = clip.num_frames();
    std::vector<double> distances;
    for (int64_t t = 0; t < frames; ++t)
      distances.push_back(Norm(initial.position[At(t)] - clip.cameras[At(t)].position));
    median_distance_ = std::max(Percentile(std::move(distances), 0.5), 1e-6);
    unit_per_pixel_ = median_distance_ / clip.cameras[0].focal_length * clip.PixelScale();
    depth_deviation_ = std::max(options.depth_share * median_distance_, MeasureTrackMotion(initial).noise);
    CollectMotion();
  }

  RefinedTrack Run() {
    RefinedTrack result;
    result.before = Residuals();
    for (int64_t round = 0; round < options_.rounds && result.note.empty(); ++round) {
      if (round > 0) LookUpDepths();
      const std::vector<std::array<double, 3>> last = positions_;
      if (!Solve()) {
        positions_ = last;
        result.note = "least squares found no solution; the track is left as it was";
      }
    }
    distance_ = pixels_.distance;
    result.after = Residuals();
    for (const auto& p : positions_) result.position.push_back({p[0], p[1], p[2]});
    return result;
  }

 private:
  bool InFront(int64_t t) const {
    double pixel[2];
    return ProjectPoint(clip_.cameras[At(t)], positions_[At(t)].data(), pixel);
  }

  void CollectMotion() {
    for (int64_t t = 0; t + 1 < clip_.num_frames(); ++t) {
      if (!pixels_.visible[At(t)] || !pixels_.visible[At(t + 1)] || !InFront(t) || !InFront(t + 1)) continue;
      if (!clip_.Step(t, 1, pixels_.pixel[At(t)]).checked) continue;
      // The cubic's support reaches over pixels without an answer; there a zero does, under the robust loss.
      flows_.push_back(torch::nan_to_num(clip_.forward[At(t)], 0.0, 0.0, 0.0));
      grids_.emplace_back(flows_.back().data_ptr<float>(), 0, static_cast<int>(clip_.height), 0,
                          static_cast<int>(clip_.width));
      interpolators_.emplace_back(grids_.back());
      motion_frames_.push_back(t);
    }
  }

  // D_t where the point projects to by now; kept where it is the same surface.
  void LookUpDepths() {
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      if (!std::isfinite(pixels_.distance[At(t)])) continue;
      double pixel[2];
      if (!ProjectPoint(clip_.cameras[At(t)], positions_[At(t)].data(), pixel)) continue;
      const double found =
          LocalDepth(clip_.depth[At(t)], {pixel[0], pixel[1]}, DepthRadius(clip_), pixels_.distance[At(t)]);
      if (std::abs(found - pixels_.distance[At(t)]) < 3 * depth_deviation_) distance_[At(t)] = found;
    }
  }

  bool Solve() {
    ceres::Problem problem;
    const int64_t frames = clip_.num_frames();
    const auto robust = [] { return new ceres::CauchyLoss(kRobustScale); };
    const auto point = [this](int64_t t) { return positions_[At(t)].data(); };
    const double pixel = clip_.PixelScale();
    for (size_t i = 0; i < motion_frames_.size(); ++i) {
      const int64_t t = motion_frames_[i];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<MotionTerm, 2, 3, 3>(new MotionTerm{
              clip_.cameras[At(t)], clip_.cameras[At(t + 1)], interpolators_[i], 1 / (options_.motion_pixels * pixel)}),
          robust(), point(t), point(t + 1));
    }
    for (int64_t t = 0; t < frames; ++t) {
      const Vec3& eye = clip_.cameras[At(t)].position;
      const bool known = std::isfinite(distance_[At(t)]);
      const double distance = known ? distance_[At(t)] : Norm(initial_.position[At(t)] - eye);
      const double deviation = known ? depth_deviation_ : options_.guessed_depth_share * median_distance_;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<GeometryTerm, 1, 3>(new GeometryTerm{eye, distance, 1 / deviation}), robust(),
          point(t));
    }
    for (const SkipLink& link : pixels_.links) {
      if (!InFront(link.frame)) continue;
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SkipTerm, 2, 3>(new SkipTerm{
                                   clip_.cameras[At(link.frame)], link.pixel, 1 / (options_.skip_pixels * pixel)}),
                               robust(), point(link.frame));
    }
    const double smooth = options_.smoothness_pixels * unit_per_pixel_;
    for (int64_t t = 1; t + 1 < frames; ++t) {
      const bool seen = initial_.visible[At(t - 1)] && initial_.visible[At(t)] && initial_.visible[At(t + 1)];
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SmoothnessTerm, 3, 3, 3, 3>(
                                   new SmoothnessTerm{1 / (seen ? smooth : smooth * options_.unseen_smoothness)}),
                               new ceres::HuberLoss(kRobustScale), point(t - 1), point(t), point(t + 1));
    }
    for (int64_t t = 0; t < frames; ++t) {
      const bool reference = t == pixels_.reference_frame;
      const double deviation = (reference ? options_.anchor_pixels : options_.prior_pixels) * unit_per_pixel_;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<AnchorTerm, 3, 3>(new AnchorTerm{initial_.position[At(t)], 1 / deviation}),
          nullptr, point(t));
    }
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    // Eigen's factorisation is serial: the result is the same everywhere, and no second pool of threads competes.
    if (ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::EIGEN_SPARSE)) {
      solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    }
    solver.max_num_iterations = 50;
    solver.num_threads = 1;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    const bool finite = std::all_of(positions_.begin(), positions_.end(), [](const auto& p) {
      return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
    });
    return summary.IsSolutionUsable() && finite;
  }

  TrackResiduals Residuals() const {
    TrackResiduals sums;
    for (size_t i = 0; i < motion_frames_.size(); ++i) {
      const int64_t t = motion_frames_[i];
      double residual[2];
      const MotionTerm term = {clip_.cameras[At(t)], clip_.cameras[At(t + 1)], interpolators_[i], 1};
      if (!term(positions_[At(t)].data(), positions_[At(t + 1)].data(), residual)) continue;
      sums.motion += residual[0] * residual[0] + residual[1] * residual[1];
      ++sums.motion_terms;
    }
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      double residual;
      if (!std::isfinite(distance_[At(t)])) continue;
      const GeometryTerm term = {clip_.cameras[At(t)].position, distance_[At(t)], 1};
      if (!term(positions_[At(t)].data(), &residual)) continue;
      sums.geometry += residual * residual;
      ++sums.geometry_terms;
    }
    for (const SkipLink& link : pixels_.links) {
      double residual[2];
      const SkipTerm term = {clip_.cameras[At(link.frame)], link.pixel, 1};
      if (!term(positions_[At(link.frame)].data(), residual)) continue;
      sums.skip += residual[0] * residual[0] + residual[1] * residual[1];
      ++sums.skip_terms;
    }
    const auto root = [](double sum, int64_t count) {
      return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
    };
    sums.motion = root(sums.motion, sums.motion_terms);
    sums.geometry = root(sums.geometry, sums.geometry_terms);
    sums.skip = root(sums.skip, sums.skip_terms);
    return sums;
  }

  const Clip& clip_;
  const PointTrack& initial_;
  const PixelTrack& pixels_;
  const RefinementOptions& options_;
  std::vector<double> distance_;  // D_t along the track; NaN: no geometry term
  std::vector<std::array<double, 3>> positions_;
  double median_distance_ = 1, unit_per_pixel_ = 1, depth_deviation_ = 1;
  std::vector<int64_t> motion_frames_;
  std::vector<torch::Tensor> flows_;
  std::deque<FlowGrid> grids_;  // addresses are kept by the interpolators
  std::deque<FlowInterpolator> interpolators_;
};

}  // namespace

RefinedTrack RefineTrack(const Clip& clip, const PointTrack& initial, const PixelTrack& pixels,
                         const RefinementOptions& options) {
  return Refiner(clip, initial, pixels, options).Run();
}

std::vector<RefinedTrack> RefineTracks(const Clip& clip, Detection* detection, const RefinementOptions& options) {
  const int64_t frames = clip.num_frames(), count = detection->count();
  CheckShape(detection->tracks, {frames, count, 3}, "key point tracks");
  detection->tracks = detection->tracks.contiguous().clone();
  float* tracks = detection->tracks.data_ptr<float>();
  std::vector<RefinedTrack> refined;
  for (int64_t n = 0; n < count; ++n) {
    PointTrack initial;
    for (int64_t t = 0; t < frames; ++t) {
      const float* p = tracks + 3 * (t * count + n);
      initial.position.push_back({p[0], p[1], p[2]});
      initial.visible.push_back(detection->visible[t][n].item<bool>());
    }
    RefinementOptions own = options;
    if (At(n) < detection->rigid.size() && detection->rigid[At(n)]) own.rounds = 0;
    refined.push_back(RefineTrack(clip, initial, detection->pixel_tracks[At(n)], own));
    for (int64_t t = 0; t < frames; ++t) {
      const Vec3& p = refined.back().position[At(t)];
      float* out = tracks + 3 * (t * count + n);
      out[0] = static_cast<float>(p.x), out[1] = static_cast<float>(p.y), out[2] = static_cast<float>(p.z);
    }
    if (!refined.back().note.empty())
      detection->notes.push_back(fmt::format("key point {}: {}", n, refined.back().note));
  }
  return refined;
}

}  // namespace editnerf
