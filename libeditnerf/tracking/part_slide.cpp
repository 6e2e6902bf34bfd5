#include "libeditnerf/tracking/part_slide.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "libeditnerf/tracking/cost_terms.h"
#include "libeditnerf/tracking/part_costs.h"
#include "libeditnerf/tracking/part_rest.h"

namespace editnerf {
namespace {

constexpr double kLeastSpread = 1e-9;  // of translations, scene units, that a line or a plane can be told from

size_t At(int64_t t) { return static_cast<size_t>(t); }

// A line or plane near to that of `axes`, which two numbers tilt: along them a slide goes by
//   freedom 1: (a, tilt_0 a, tilt_1 a);   2: (a, b, tilt_0 a + tilt_1 b)
template <int kFreedom, class T>
void GoBy(const T* tilt, const T* place, T* along) {
  along[0] = place[0];
  if constexpr (kFreedom == 1) {
    along[1] = tilt[0] * place[0];
    along[2] = tilt[1] * place[0];
  } else {
    along[1] = place[1];
    along[2] = tilt[0] * place[0] + tilt[1] * place[1];
  }
}

// position + the slide's way, projected.
template <int kFreedom>
struct SlidePixelTerm {
  const Camera& camera;
  const std::array<Vec3, 3>& axes;
  Pixel pixel;
  double weight;

  template <class T>
  bool operator()(const T* tilt, const T* place, const T* position, T* residual) const {
    T along[3];
    GoBy<kFreedom>(tilt, place, along);
    const T point[3] = {position[0] + axes[0].x * along[0] + axes[1].x * along[1] + axes[2].x * along[2],
                        position[1] + axes[0].y * along[0] + axes[1].y * along[1] + axes[2].y * along[2],
                        position[2] + axes[0].z * along[0] + axes[1].z * along[1] + axes[2].z * along[2]};
    return PixelMiss(camera, pixel, weight, point, residual);
  }
};

Vec3 WayOf(const Slide& slide, const std::array<double, 2>& tilt, int64_t t) {
  double along[3];
  if (slide.freedom == 1) {
    GoBy<1>(tilt.data(), slide.place[At(t)].data(), along);
  } else {
    GoBy<2>(tilt.data(), slide.place[At(t)].data(), along);
  }
  return slide.axes[0] * along[0] + slide.axes[1] * along[1] + slide.axes[2] * along[2];
}

template <int kFreedom>
std::optional<double> Solve(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options,
                            const std::vector<int64_t>& frames, Slide* slide, RigidPart* part) {
  std::vector<PartPoint> points = part->points;
  std::array<double, 2> tilt = {0, 0};
  Slide solved = *slide;
  const double distance = DistanceOf(clip, *part), per_pixel = PixelAt(clip, distance);
  ceres::Problem problem;
  const auto place = [&solved](int64_t t) { return solved.place[At(t)].data(); };
  ForTrackedPixels(clip, tracks, options, frames, &points,
                   [&](const Camera& camera, const Pixel& pixel, double weight, ceres::LossFunction* loss, int64_t t,
                       PartPoint* point) {
                     problem.AddResidualBlock(
                         new ceres::AutoDiffCostFunction<SlidePixelTerm<kFreedom>, 2, 2, kFreedom, 3>(
                             new SlidePixelTerm<kFreedom>{camera, solved.axes, pixel, weight}),
                         loss, tilt.data(), place(t), point->position.data());
                   });
  if (!problem.HasParameterBlock(tilt.data())) return std::nullopt;
  AddShape(&problem, part->center, options.shape * distance, &points);
  for (size_t i = 0; i + 1 < frames.size(); ++i) {
    const bool rests = RestsAt(clip, *part, options, frames, i);
    const double deviation = (rests ? kStillPixels : options.shift_pixels) * per_pixel;
    problem.AddResidualBlock(DifferenceTerm<kFreedom>::New(1 / deviation),
                             rests ? nullptr : new ceres::HuberLoss(kTotalVariation), place(frames[i]),
                             place(frames[i + 1]));
  }
  if (problem.HasParameterBlock(place(part->reference))) problem.SetParameterBlockConstant(place(part->reference));
  const std::optional<double> cost = SolveSmall(&problem, ceres::DENSE_SCHUR, options.iterations);
  if (!cost) return std::nullopt;
  part->points = points;
  part->center = MiddleOf(points);
  for (const int64_t t : frames) part->pose[At(t)] = {{0, 0, 0}, ToArray(WayOf(solved, tilt, t))};
  if (const std::optional<Slide> nearest = NearestSlide(*part, frames, kFreedom)) *slide = *nearest;
  return cost;
}

}  // namespace

std::optional<Slide> NearestSlide(const RigidPart& part, const std::vector<int64_t>& frames, int freedom) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> places;
  for (const int64_t t : frames) {
    const auto& translation = part.pose[At(t)].translation;
    places.emplace_back(translation[0], translation[1], translation[2]);
    mean += places.back() / static_cast<double>(frames.size());
  }
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& place : places) spread += (place - mean) * (place - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> directions(spread);
  if (!(directions.eigenvalues()[3 - freedom] > kLeastSpread * kLeastSpread)) return std::nullopt;
  Slide slide;
  slide.freedom = freedom;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = directions.eigenvectors().col(2 - i);
    slide.axes[At(i)] = {axis.x(), axis.y(), axis.z()};
  }
  slide.place.assign(part.pose.size(), {0, 0});
  for (size_t i = 0; i < frames.size(); ++i) {
    for (int k = 0; k < freedom; ++k)
      slide.place[At(frames[i])][At(k)] = places[i].dot(directions.eigenvectors().col(2 - k));
  }
  return slide;
}

void SetPoses(const Slide& slide, const std::vector<int64_t>& frames, RigidPart* part) {
  for (const int64_t t : frames) part->pose[At(t)] = {{0, 0, 0}, ToArray(WayOf(slide, {0, 0}, t))};
}

std::optional<double> SolveSlide(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                 const PartSolverOptions& options, const std::vector<int64_t>& frames, Slide* slide,
                                 RigidPart* part) {
  return slide->freedom == 1 ? Solve<1>(clip, tracks, options, frames, slide, part)
                             : Solve<2>(clip, tracks, options, frames, slide, part);
}

void FillPlaces(RigidPart* part) {
  std::optional<Slide> slide = NearestSlide(*part, SeenFrames(*part), FreedomOf(part->motion));
  if (!slide) return;
  std::vector<int64_t> filled;
  for (size_t k = 0; k < 2; ++k) {
    std::vector<double> along;
    for (const auto& place : slide->place) along.push_back(place[k]);
    filled = FillBetween(*part, &along);
    for (size_t t = 0; t < along.size(); ++t) slide->place[t][k] = along[t];
  }
  SetPoses(*slide, filled, part);
}

int FreedomOf(PartMotion motion) { return motion == PartMotion::kRail ? 1 : 2; }

}  // namespace editnerf
