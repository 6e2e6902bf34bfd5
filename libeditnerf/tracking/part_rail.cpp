#include "libeditnerf/tracking/part_rail.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "libeditnerf/tracking/cost_terms.h"
#include "libeditnerf/tracking/part_costs.h"

namespace editnerf {
namespace {

constexpr double kGauge = 1e-2;  // of what the images leave open: the line's length

size_t At(int64_t t) { return static_cast<size_t>(t); }

// position + shift along, projected.
struct RailPixelTerm {
  const Camera& camera;
  Pixel pixel;
  double weight;

  template <class T>
  bool operator()(const T* along, const T* shift, const T* position, T* residual) const {
    using std::sqrt;
    const T length = sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2]);
    T point[3];
    for (int i = 0; i < 3; ++i) point[i] = position[i] + along[i] * (shift[0] / length);
    return PixelMiss(camera, pixel, weight, point, residual);
  }
};

}  // namespace

std::optional<Rail> NearestRail(const RigidPart& part, const std::vector<int64_t>& frames) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> places;
  for (const int64_t t : frames) {
    const auto& translation = part.pose[At(t)].translation;
    places.emplace_back(translation[0], translation[1], translation[2]);
    mean += places.back() / static_cast<double>(frames.size());
  }
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& place : places) spread += (place - mean) * (place - mean).transpose();
  const Eigen::Vector3d along = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2);
  Rail rail;
  rail.along = {along.x(), along.y(), along.z()};
  rail.shift.assign(part.pose.size(), 0);
  double low = INFINITY, high = -INFINITY;
  for (size_t i = 0; i < frames.size(); ++i) {
    const double shift = places[i].dot(along);
    rail.shift[At(frames[i])] = shift;
    low = std::min(low, shift), high = std::max(high, shift);
  }
  if (!(high > low)) return std::nullopt;
  return rail;
}

void SetPoses(const Rail& rail, const std::vector<int64_t>& frames, RigidPart* part) {
  for (const int64_t t : frames) {
    part->pose[At(t)].rotation = {0, 0, 0};
    part->pose[At(t)].translation = ToArray(rail.along * rail.shift[At(t)]);
  }
}

std::optional<double> SolveRail(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, const std::vector<int64_t>& frames, Rail* rail,
                                RigidPart* part) {
  Rail solved = *rail;
  std::vector<PartPoint> points = part->points;
  std::array<double, 3> along = ToArray(rail->along);
  const double distance = std::max(1e-6, Norm(part->center - clip.cameras[At(part->reference)].position));
  const double per_pixel = distance / clip.cameras[0].focal_length * clip.PixelScale();
  ceres::Problem problem;
  const auto shift = [&solved](int64_t t) { return &solved.shift[At(t)]; };
  ForTrackedPixels(clip, tracks, options, frames, &points,
                   [&](const Camera& camera, const Pixel& pixel, double weight, ceres::LossFunction* loss, int64_t t,
                       PartPoint* point) {
                     problem.AddResidualBlock(new ceres::AutoDiffCostFunction<RailPixelTerm, 2, 3, 1, 3>(
                                                  new RailPixelTerm{camera, pixel, weight}),
                                              loss, along.data(), shift(t), point->position.data());
                   });
  if (!problem.HasParameterBlock(along.data())) return std::nullopt;
  AddShape(&problem, part->center, options.shape * distance, &points);
  for (size_t i = 0; i + 1 < frames.size(); ++i) {
    problem.AddResidualBlock(DifferenceTerm<1>::New(1 / (options.shift_pixels * per_pixel)),
                             new ceres::HuberLoss(kTotalVariation), shift(frames[i]), shift(frames[i + 1]));
  }
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<UnitLengthTerm, 1, 3>(new UnitLengthTerm{1 / kGauge}),
                           nullptr, along.data());
  if (problem.HasParameterBlock(shift(part->reference))) problem.SetParameterBlockConstant(shift(part->reference));
  const std::optional<double> cost = SolveSmall(&problem, ceres::DENSE_SCHUR, options.iterations);
  if (!cost) return std::nullopt;
  solved.along = Normalized(ToVec3(along));
  *rail = solved;
  part->points = points;
  part->center = MiddleOf(points);
  SetPoses(*rail, frames, part);
  return cost;
}

void FillShifts(RigidPart* part) {
  const std::vector<int64_t> seen = SeenFrames(*part);
  std::optional<Rail> rail = NearestRail(*part, seen);
  if (!rail) return;
  SetPoses(*rail, FillBetween(*part, &rail->shift), part);
}

}  // namespace editnerf
