#include "libeditnerf/field/hinge_way.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "libeditnerf/base/shape.h"
#include "libeditnerf/geometry/se3.h"

namespace editnerf {
namespace {

constexpr double kLeastAngle = 10 * M_PI / 180;
// Of turns from the axis and of the point from its arc: root mean square, share of the way.
constexpr double kMostOff = 0.02;

// exp([r]) for turns [T, 3]: [T, 3, 3].
torch::Tensor Rotations(const torch::Tensor& turns) {
  return ExpSo3(turns.unsqueeze(1), torch::eye(3, turns.options()).unsqueeze(0)).transpose(1, 2);
}

double RootMeanSquare(const torch::Tensor& vectors) { return vectors.square().sum(-1).mean().sqrt().item<double>(); }

// The point is at center + R arm, and any place on the axis is as good a center: the one nearest to the origin.
struct Arc {
  torch::Tensor center, arm;  // [3, 1]

  Arc(const torch::Tensor& points, const torch::Tensor& rotations) {
    const int64_t count = points.size(0);
    const torch::Tensor rows = torch::cat({torch::eye(3, points.options()).expand({count, 3, 3}), rotations}, 2);
    const torch::Tensor both =
        torch::matmul(torch::linalg_pinv(rows.reshape({3 * count, 6}), 1e-6), points.reshape({3 * count, 1}));
    center = both.slice(0, 0, 3), arm = both.slice(0, 3);
  }
  torch::Tensor At(const torch::Tensor& rotations) const { return (center + torch::matmul(rotations, arm)).squeeze(2); }
};

}  // namespace

HingeWay BeyondHinge(const torch::Tensor& coordinates, const torch::Tensor& turns, double share) {
  CheckShape(coordinates, {kAny, 3}, "coordinates of a hinge's way");
  CheckShape(turns, {coordinates.size(0), 3}, "turns of a hinge's way");
  const torch::NoGradGuard no_grad;
  const torch::Tensor points = coordinates.to(torch::kCPU, torch::kFloat64), known = turns.to(points.options());
  HingeWay way = {points.slice(0, 0, 0), known.slice(0, 0, 0)};
  if (points.size(0) < 2) return way;

  const torch::Tensor axis = std::get<1>(torch::linalg_eigh(torch::matmul(known.t(), known))).select(1, 2);
  const torch::Tensor angle = torch::matmul(known, axis);
  const double low = angle.min().item<double>(), high = angle.max().item<double>(), range = high - low;
  const double beyond = std::min(share * range, M_PI - range / 2);
  if (range < kLeastAngle || beyond <= 0) return way;
  const torch::Tensor about = angle.unsqueeze(1) * axis;
  if (RootMeanSquare(known - about) > kMostOff * range) return way;
  const torch::Tensor rotations = Rotations(about);
  const Arc arc(points, rotations);
  const double radius = torch::linalg_cross(axis, arc.arm.squeeze(1)).norm().item<double>();
  if (RootMeanSquare(arc.At(rotations) - points) > kMostOff * range * radius) return way;

  const auto rows = static_cast<int64_t>(std::ceil(share * static_cast<double>(points.size(0))));
  const torch::Tensor further = beyond * torch::arange(1, rows + 1, points.options()) / static_cast<double>(rows);
  const torch::Tensor added = torch::cat({low - further, high + further}).unsqueeze(1) * axis;
  way = {arc.At(Rotations(added)), added};
  return way;
}

}  // namespace editnerf
