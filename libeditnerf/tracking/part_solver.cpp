#include "libeditnerf/tracking/part_solver.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "libeditnerf/tracking/cost_terms.h"
#include "libeditnerf/tracking/part_costs.h"
#include "libeditnerf/tracking/part_rest.h"

namespace editnerf {
namespace {

constexpr double kLeastScaled = 1;  // pixels at 320 wide, by which another distance shifts it in some frame

size_t At(int64_t t) { return static_cast<size_t>(t); }

struct PixelTerm {
  const Camera& camera;
  Pixel pixel;
  Vec3 center;
  double weight;

  template <class T>
  bool operator()(const T* rotation, const T* translation, const T* position, T* residual) const {
    const T from[3] = {position[0] - T(center.x), position[1] - T(center.y), position[2] - T(center.z)};
    T point[3];
    ceres::AngleAxisRotatePoint(rotation, from, point);
    point[0] += T(center.x) + translation[0];
    point[1] += T(center.y) + translation[1];
    point[2] += T(center.z) + translation[2];
    return PixelMiss(camera, pixel, weight, point, residual);
  }
};

// How much farther from the cameras the whole part has become than it was, as a share. Images do not tell: whatever
// draws its way together would decide it, if by ever so little.
class ScaleTerm : public ceres::CostFunction {
 public:
  // One each for every frame but the reference. farther: what is added to the shift for each 100 %.
  ScaleTerm(std::vector<Vec3> shifts, std::vector<Vec3> farther)
      : shifts_(std::move(shifts)), farther_(std::move(farther)) {
    double length = 0;
    for (const Vec3& v : farther_) length += Dot(v, v);
    for (Vec3& v : farther_) v = v * (1 / (kShare * length));
    set_num_residuals(1);
    mutable_parameter_block_sizes()->assign(shifts_.size(), 3);
  }

  bool Evaluate(double const* const* shifts, double* residual, double** jacobians) const override {
    *residual = 0;
    for (size_t i = 0; i < shifts_.size(); ++i) {
      const Vec3 by = Vec3{shifts[i][0], shifts[i][1], shifts[i][2]} - shifts_[i];
      *residual += Dot(farther_[i], by);
      if (jacobians == nullptr || jacobians[i] == nullptr) continue;
      const std::array<double, 3> slope = ToArray(farther_[i]);
      std::copy(slope.begin(), slope.end(), jacobians[i]);
    }
    return true;
  }

 private:
  static constexpr double kShare = 1e-4;  // standard deviation

  std::vector<Vec3> shifts_, farther_;
};

class Solver {
 public:
  Solver(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options, RigidPart* part)
      : clip_(clip), tracks_(tracks), options_(options), part_(*part) {
    distance_ = DistanceOf(clip, *part);
    per_pixel_ = PixelAt(clip, distance_);
  }

  int64_t AddPixels(const std::vector<int64_t>& frames) {
    int64_t count = 0;
    ForTrackedPixels(clip_, tracks_, options_, frames, &part_.points,
                     [&](const Camera& camera, const Pixel& pixel, double weight, ceres::LossFunction* loss, int64_t t,
                         PartPoint* point) {
                       problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PixelTerm, 2, 3, 3, 3>(
                                                     new PixelTerm{camera, pixel, part_.center, weight}),
                                                 loss, Rotation(t), Translation(t), point->position.data());
                       ++count;
                     });
    return count;
  }

  // Between each frame and the one that follows it in the list; over gaps the part has more time to move.
  void AddSmoothness(const std::vector<int64_t>& frames) {
    for (size_t i = 0; i + 1 < frames.size(); ++i) {
      const int64_t a = frames[i], b = frames[i + 1];
      if (RestsAt(clip_, part_, options_, frames, i)) {
        problem_.AddResidualBlock(DifferenceTerm<3>::New(1 / (kStillPixels * per_pixel_)), nullptr, Translation(a),
                                  Translation(b));
        problem_.AddResidualBlock(DifferenceTerm<3>::New(distance_ / (kStillPixels * per_pixel_)), nullptr, Rotation(a),
                                  Rotation(b));
        continue;
      }
      AddTurn(a, b);
      problem_.AddResidualBlock(DifferenceTerm<3>::New(1 / (options_.shift_pixels * per_pixel_)),
                                new ceres::HuberLoss(kTotalVariation), Translation(a), Translation(b));
      if (i == 0 || frames[i - 1] != a - 1 || b != a + 1) continue;
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<SmoothnessTerm, 3, 3, 3, 3>(
                                    new SmoothnessTerm{1 / (options_.acceleration_pixels * per_pixel_)}),
                                new ceres::HuberLoss(kRobustPixels), Translation(a - 1), Translation(a),
                                Translation(b));
    }
  }

  void AddTurn(int64_t a, int64_t b) {
    problem_.AddResidualBlock(DifferenceTerm<3>::New(1 / options_.turn), new ceres::HuberLoss(kTotalVariation),
                              Rotation(a), Rotation(b));
  }

  void HoldScale(const std::vector<int64_t>& frames) {
    const Vec3 eye = clip_.cameras[At(part_.reference)].position;
    std::vector<Vec3> shifts, farther;
    std::vector<double*> blocks;
    double most = 0;
    for (const int64_t t : frames) {
      if (t == part_.reference) continue;
      shifts.push_back(ToVec3(part_.pose[At(t)].translation));
      farther.push_back(shifts.back() - (clip_.cameras[At(t)].position - eye));
      blocks.push_back(Translation(t));
      most = std::max(most, Norm(farther.back()));
    }
    if (most < kLeastScaled * per_pixel_) return;
    problem_.AddResidualBlock(new ScaleTerm(std::move(shifts), std::move(farther)), nullptr, blocks);
  }

  void AddShape() { editnerf::AddShape(&problem_, part_.center, options_.shape * distance_, &part_.points); }

  void Hold(double* block) {
    if (problem_.HasParameterBlock(block)) problem_.SetParameterBlockConstant(block);
  }
  void HoldPose(int64_t t) { Hold(Rotation(t)), Hold(Translation(t)); }
  void HoldTurns(const std::vector<int64_t>& frames) {
    for (const int64_t t : frames) Hold(Rotation(t));
  }
  void HoldPoints() {
    for (PartPoint& point : part_.points) Hold(point.position.data());
  }

  std::optional<double> Run(ceres::LinearSolverType type, int iterations) {
    return SolveSmall(&problem_, type, iterations);
  }

  double* Rotation(int64_t t) { return part_.pose[At(t)].rotation.data(); }
  double* Translation(int64_t t) { return part_.pose[At(t)].translation.data(); }

 private:
  const Clip& clip_;
  const std::vector<FlowTrack>& tracks_;
  const PartSolverOptions& options_;
  RigidPart& part_;
  double distance_ = 1, per_pixel_ = 1;
  ceres::Problem problem_;
};

}  // namespace

double DistanceOf(const Clip& clip, const RigidPart& part) {
  return std::max(1e-6, Norm(part.center - clip.cameras[static_cast<size_t>(part.reference)].position));
}

double PixelAt(const Clip& clip, double distance) {
  return distance / clip.cameras[0].focal_length * clip.PixelScale();
}

bool SolvePose(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options, int64_t t,
               int64_t towards, RigidPart* part) {
  const RigidPose before = part->pose[At(t)];
  Solver solver(clip, tracks, options, part);
  if (solver.AddPixels({t}) < 3) return false;
  solver.AddTurn(t, towards);
  solver.HoldPose(towards);
  solver.HoldPoints();
  if (solver.Run(ceres::DENSE_QR, 30)) return true;
  part->pose[At(t)] = before;
  return false;
}

std::optional<double> SolvePart(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, const std::vector<int64_t>& frames, RigidPart* part) {
  const RigidPart before = *part;
  Solver solver(clip, tracks, options, part);
  if (solver.AddPixels(frames) < 3) return std::nullopt;
  solver.AddSmoothness(frames);
  solver.AddShape();
  if (options.hold_scale) solver.HoldScale(frames);
  solver.HoldPose(part->reference);
  if (!part->turns()) solver.HoldTurns(frames);
  const std::optional<double> cost = solver.Run(ceres::DENSE_SCHUR, options.iterations);
  if (!cost) *part = before;
  return cost;
}

}  // namespace editnerf
