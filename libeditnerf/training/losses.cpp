#include "libeditnerf/training/losses.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/geometry/image_lookup.h"
#include "libeditnerf/geometry/projection.h"

namespace editnerf {
namespace {

// values and valid [P].
torch::Tensor ValidMean(const torch::Tensor& values, const torch::Tensor& valid) {
  const auto kept = torch::where(valid, values, torch::zeros_like(values));
  return kept.sum() / valid.sum().clamp_min(1).to(values.dtype());
}

void CheckPairs(const CameraTensors& cameras, const torch::Tensor& maps, const FramePairs& pairs, const char* name) {
  CheckShape(pairs.frame, {kAny}, "frame");
  CheckShape(pairs.key_points, {pairs.frame.size(0), kAny, 3}, "key_points");
  CheckShape(pairs.key_points_next, {pairs.frame.size(0), pairs.key_points.size(1), 3}, "key_points_next");
  if (maps.size(1) != cameras.height || maps.size(2) != cameras.width) {
    Throw<ShapeError>("{}: expected the cameras' {} x {} pixels, found {}", name, cameras.width, cameras.height,
                      ShapeString(maps));
  }
}

// Squared difference of distance and depth map; frame [P], key_points [P, N, 3].
torch::Tensor DepthError(const CameraTensors& cameras, const torch::Tensor& depth, const torch::Tensor& frame,
                         const torch::Tensor& key_points) {
  const auto frames = frame.repeat_interleave(key_points.size(1));
  const auto projected = ProjectPoints(cameras, frames, key_points.reshape({-1, 3}));
  const auto measured = BilinearLookUp(depth, frames, projected.pixel);
  const auto valid = torch::logical_and(projected.valid, measured.valid);
  return ValidMean((projected.distance - measured.value.squeeze(1)).square(), valid);
}

}  // namespace

torch::Tensor ReconstructionLoss(const torch::Tensor& rgb, const torch::Tensor& rgb_coarse, const torch::Tensor& target,
                                 const torch::Tensor& emphasis) {
  CheckShape(rgb, {kAny, 3}, "rgb");
  CheckShape(target, {rgb.size(0), 3}, "target");
  if (emphasis.defined()) CheckShape(emphasis, {rgb.size(0)}, "emphasis");
  const auto mean = [&](const torch::Tensor& shown) {
    const torch::Tensor squares = (shown - target).square();
    return emphasis.defined() ? (squares * emphasis.unsqueeze(1)).mean() : squares.mean();
  };
  if (!rgb_coarse.defined()) return mean(rgb);
  CheckShape(rgb_coarse, {rgb.size(0), 3}, "rgb_coarse");
  return mean(rgb) + mean(rgb_coarse);
}

torch::Tensor MotionLoss(const CameraTensors& cameras, const torch::Tensor& flow, const FramePairs& pairs,
                         double reference_width) {
  CheckShape(flow, {kAny, kAny, kAny, 2}, "flow");
  CheckPairs(cameras, flow, pairs, "flow");
  const auto frames = pairs.frame.repeat_interleave(pairs.key_points.size(1));
  const auto here = ProjectPoints(cameras, frames, pairs.key_points.reshape({-1, 3}));
  const auto next = ProjectPoints(cameras, frames + 1, pairs.key_points_next.reshape({-1, 3}));
  const auto motion = BilinearLookUp(flow, frames, here.pixel);
  const auto valid = torch::logical_and(torch::logical_and(here.valid, next.valid), motion.valid);
  const double scale = reference_width / static_cast<double>(cameras.width);
  return ValidMean((next.pixel - here.pixel - motion.value).square().sum(1), valid) * (scale * scale);
}

torch::Tensor GeometryLoss(const CameraTensors& cameras, const torch::Tensor& depth, const FramePairs& pairs) {
  CheckShape(depth, {kAny, kAny, kAny}, "depth");
  CheckPairs(cameras, depth, pairs, "depth");
  return (DepthError(cameras, depth, pairs.frame, pairs.key_points) +
          DepthError(cameras, depth, pairs.frame + 1, pairs.key_points_next)) /
         2;
}

torch::Tensor WarpRegularisation(const torch::Tensor& x_observed, const torch::Tensor& x_canonical,
                                 const torch::Tensor& valid) {
  CheckShape(x_observed, {kAny, 3}, "x_observed");
  CheckShape(x_canonical, {x_observed.size(0), 3}, "x_canonical");
  CheckShape(valid, {x_observed.size(0)}, "valid");
  return ValidMean((x_observed - x_canonical).square().sum(1), valid);
}

torch::Tensor AmbientRegularisation(const torch::Tensor& ambient, const torch::Tensor& valid) {
  CheckShape(ambient, {kAny, kAny}, "ambient");
  CheckShape(valid, {ambient.size(0)}, "valid");
  const auto squares = ambient.square().sum(1);
  return torch::where(valid, squares, torch::zeros_like(squares)).mean();
}

}  // namespace editnerf
