#include "libeditnerf/tracking/part_hinge.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "libeditnerf/tracking/cost_terms.h"
#include "libeditnerf/tracking/part_costs.h"

namespace editnerf {
namespace {

constexpr double kLeastTurn = 0.1;  // radians, that a hinge can be told from
constexpr double kGauge = 1e-2;     // of what the images leave open: the axis's length, and where on it is `through`

size_t At(int64_t t) { return static_cast<size_t>(t); }
Eigen::Vector3d ToEigen(const Vec3& v) { return {v.x, v.y, v.z}; }
Vec3 FromEigen(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// R(angle axis) (position - through) + through, projected.
struct HingePixelTerm {
  const Camera& camera;
  Pixel pixel;
  double weight;

  template <class T>
  bool operator()(const T* axis, const T* through, const T* angle, const T* position, T* residual) const {
    using std::sqrt;
    const T length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    T rotation[3], from[3], point[3];
    for (int i = 0; i < 3; ++i) {
      rotation[i] = axis[i] * (angle[0] / length);
      from[i] = position[i] - through[i];
    }
    ceres::AngleAxisRotatePoint(rotation, from, point);
    for (int i = 0; i < 3; ++i) point[i] += through[i];
    return PixelMiss(camera, pixel, weight, point, residual);
  }
};

}  // namespace

std::optional<Hinge> NearestHinge(const RigidPart& part, const std::vector<int64_t>& frames) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double most = 0;
  for (const int64_t t : frames) {
    const Eigen::Vector3d turn = ToEigen(ToVec3(part.pose[At(t)].rotation));
    spread += turn * turn.transpose();
    most = std::max(most, turn.norm());
  }
  if (!(most > kLeastTurn)) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> directions(spread);
  const Eigen::Vector3d axis = directions.eigenvectors().col(2);
  Hinge hinge;
  hinge.axis = FromEigen(axis);
  hinge.angle.assign(part.pose.size(), 0);
  // The centre goes by (I - R) (through - centre).
  Eigen::Matrix3d normal = 1e-6 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const int64_t t : frames) {
    const double angle = ToEigen(ToVec3(part.pose[At(t)].rotation)).dot(axis);
    hinge.angle[At(t)] = angle;
    const Eigen::Matrix3d left = Eigen::Matrix3d::Identity() - Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    normal += left.transpose() * left;
    right += left.transpose() * ToEigen(ToVec3(part.pose[At(t)].translation));
  }
  hinge.through = part.center + FromEigen(normal.ldlt().solve(right));
  return hinge;
}

Vec3 PlaceAt(const Hinge& hinge, double angle, const Vec3& position) {
  const std::array<double, 3> turn = ToArray(hinge.axis * angle), from = ToArray(position - hinge.through);
  std::array<double, 3> to;
  ceres::AngleAxisRotatePoint(turn.data(), from.data(), to.data());
  return hinge.through + ToVec3(to);
}

void SetPoses(const Hinge& hinge, const std::vector<int64_t>& frames, RigidPart* part) {
  for (const int64_t t : frames) {
    const Vec3 center = PlaceAt(hinge, hinge.angle[At(t)], part->center);
    part->pose[At(t)].rotation = ToArray(hinge.axis * hinge.angle[At(t)]);
    part->pose[At(t)].translation = ToArray(center - part->center);
  }
}

std::optional<double> SolveHinge(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                 const PartSolverOptions& options, const std::vector<int64_t>& frames, Hinge* hinge,
                                 RigidPart* part) {
  Hinge solved = *hinge;
  std::vector<PartPoint> points = part->points;
  std::array<double, 3> axis = ToArray(hinge->axis), through = ToArray(hinge->through);
  const double distance = DistanceOf(clip, *part);
  ceres::Problem problem;
  const auto angle = [&solved](int64_t t) { return &solved.angle[At(t)]; };
  ForTrackedPixels(clip, tracks, options, frames, &points,
                   [&](const Camera& camera, const Pixel& pixel, double weight, ceres::LossFunction* loss, int64_t t,
                       PartPoint* point) {
                     problem.AddResidualBlock(new ceres::AutoDiffCostFunction<HingePixelTerm, 2, 3, 3, 1, 3>(
                                                  new HingePixelTerm{camera, pixel, weight}),
                                              loss, axis.data(), through.data(), angle(t), point->position.data());
                   });
  if (!problem.HasParameterBlock(axis.data())) return std::nullopt;
  AddShape(&problem, part->center, options.shape * distance, &points);
  for (size_t i = 0; i + 1 < frames.size(); ++i) {
    problem.AddResidualBlock(DifferenceTerm<1>::New(1 / options.turn), new ceres::HuberLoss(kTotalVariation),
                             angle(frames[i]), angle(frames[i + 1]));
  }
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<UnitLengthTerm, 1, 3>(new UnitLengthTerm{1 / kGauge}),
                           nullptr, axis.data());
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<AnchorTerm, 3, 3>(new AnchorTerm{part->center, 1 / distance}), nullptr,
      through.data());
  if (problem.HasParameterBlock(angle(part->reference))) problem.SetParameterBlockConstant(angle(part->reference));
  const std::optional<double> cost = SolveSmall(&problem, ceres::DENSE_SCHUR, options.iterations);
  if (!cost) return std::nullopt;
  solved.axis = Normalized(ToVec3(axis));
  solved.through = ToVec3(through);
  *hinge = solved;
  part->points = points;
  part->center = MiddleOf(points);
  SetPoses(*hinge, frames, part);
  return cost;
}

void FillAngles(RigidPart* part) {
  const std::vector<int64_t> seen = SeenFrames(*part);
  std::optional<Hinge> hinge = NearestHinge(*part, seen);
  if (!hinge) return;
  SetPoses(*hinge, FillBetween(*part, &hinge->angle), part);
}

}  // namespace editnerf
