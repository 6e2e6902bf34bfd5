// What the least-squares problems over a rigid part have in common: how tracks count, and how steps between frames do.
#pragma once

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "libeditnerf/tracking/cost_terms.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

constexpr double kRobustPixels = 1.5;    // standard deviations from which a pixel counts for less
constexpr double kTotalVariation = 0.3;  // standard deviations from which motion counts by its length

// A chained track counts for a few pixels at most: its errors go on from frame to frame. Times a pixel's weight.
inline double ShareOf(const FlowTrack& track) {
  constexpr double kIndependent = 8;
  if (!track.chained) return 1;
  return std::sqrt(std::min(1.0, kIndependent / static_cast<double>(track.pixel.size())));
}

inline ceres::LossFunction* PixelLoss(const FlowTrack& track) {
  return new ceres::CauchyLoss(kRobustPixels * ShareOf(track));
}

// | a - b |, of kSize numbers. weight: the inverse of a standard deviation.
template <int kSize>
struct DifferenceTerm {
  double weight;

  template <class T>
  bool operator()(const T* a, const T* b, T* residual) const {
    for (int i = 0; i < kSize; ++i) residual[i] = T(weight) * (a[i] - b[i]);
    return true;
  }

  static ceres::CostFunction* New(double weight) {
    return new ceres::AutoDiffCostFunction<DifferenceTerm, kSize, kSize, kSize>(new DifferenceTerm{weight});
  }
};

// residual [2]: how far a point is seen from a pixel. False where the camera does not see it.
template <class T>
bool PixelMiss(const Camera& camera, const Pixel& pixel, double weight, const T* point, T* residual) {
  T projected[2];
  if (!ProjectPoint(camera, point, projected)) return false;
  residual[0] = T(weight) * (projected[0] - T(pixel.u));
  residual[1] = T(weight) * (projected[1] - T(pixel.v));
  return true;
}

// add(camera, pixel, weight, loss, frame, point) for every pixel of the points' tracks in the given frames.
template <class Add>
void ForTrackedPixels(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options,
                      const std::vector<int64_t>& frames, std::vector<PartPoint>* points, const Add& add) {
  std::vector<bool> wanted(static_cast<size_t>(clip.num_frames()), false);
  for (const int64_t t : frames) wanted[static_cast<size_t>(t)] = true;
  for (PartPoint& point : *points) {
    for (const size_t i : point.tracks) {
      const FlowTrack& track = tracks[i];
      const double weight = ShareOf(track) / (options.flow_pixels * clip.PixelScale());
      for (int64_t t = track.first; t < track.end(); ++t) {
        if (!wanted[static_cast<size_t>(t)]) continue;
        add(clip.cameras[static_cast<size_t>(t)], track.At(t), weight, PixelLoss(track), t, &point);
      }
    }
  }
}

// | p - target | along x and y, or along z. In pairs, as pixels come: Ceres eliminates points of one size of term
// faster.
struct NearTerm {
  Vec3 target;
  double weight;
  bool z;

  template <class T>
  bool operator()(const T* point, T* residual) const {
    residual[0] = T(weight) * (z ? point[2] - T(target.z) : point[0] - T(target.x));
    residual[1] = z ? T(0) : T(weight) * (point[1] - T(target.y));
    return true;
  }
};

// Holds points near the part's centre. deviation: scene units.
inline void AddShape(ceres::Problem* problem, const Vec3& center, double deviation, std::vector<PartPoint>* points) {
  for (PartPoint& point : *points) {
    for (const bool in_depth : {false, true}) {
      problem->AddResidualBlock(
          new ceres::AutoDiffCostFunction<NearTerm, 2, 3>(new NearTerm{center, 1 / deviation, in_depth}), nullptr,
          point.position.data());
    }
  }
}

inline Vec3 MiddleOf(const std::vector<PartPoint>& points) {
  Vec3 middle;
  for (const PartPoint& point : points) middle += ToVec3(point.position) / static_cast<double>(points.size());
  return middle;
}

// Whether a solution came out, and at which cost.
inline std::optional<double> SolveSmall(ceres::Problem* problem, ceres::LinearSolverType type, int iterations) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = type;
  if (ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::EIGEN_SPARSE))
    solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  solver.max_num_iterations = iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, problem, &summary);
  if (!summary.IsSolutionUsable()) return std::nullopt;
  return summary.final_cost;
}

}  // namespace editnerf
