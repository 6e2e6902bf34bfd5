// What the least-squares problems over a rigid part have in common: how tracks count, and how steps between frames do.
#pragma once

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "libeditnerf/tracking/flow_tracks.h"

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
