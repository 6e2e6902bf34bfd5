#include "libeditnerf/geometry/projection.h"

#include "libeditnerf/base/shape.h"
#include "libeditnerf/geometry/distortion.h"

namespace editnerf {
namespace {

constexpr double kNearestDepth = 1e-6;
constexpr double kLargestTangent = 1e3;
constexpr double kLargestCoordinate = 1e9;

}  // namespace

// Every `where` stands before the operation that it protects: behind it, a masked NaN would still reach the gradients.
ProjectedPoints ProjectPoints(const CameraTensors& cameras, const torch::Tensor& frame, const torch::Tensor& point) {
  CheckShape(frame, {kAny}, "frame");
  CheckShape(point, {frame.size(0), 3}, "point");
  const auto rows = [&frame](const torch::Tensor& table) { return table.index_select(0, frame); };
  const torch::Tensor position = rows(cameras.position);
  const torch::Tensor given = point.to(position.scalar_type());
  const torch::Tensor usable = (given.abs() < kLargestCoordinate).all(-1, true);
  const torch::Tensor from_camera = torch::where(usable, given, position) - position;
  const torch::Tensor in_camera = (rows(cameras.orientation) * from_camera.unsqueeze(-2)).sum(-1);

  ProjectedPoints projected;
  projected.depth_along_axis = in_camera.select(-1, 2);
  const torch::Tensor squared = from_camera.square().sum(-1);
  const torch::Tensor apart = squared > 0;
  projected.distance = torch::where(apart, torch::where(apart, squared, torch::ones_like(squared)).sqrt(), squared);

  const torch::Tensor& depth = projected.depth_along_axis;
  const torch::Tensor lateral = in_camera.narrow(-1, 0, 2);
  projected.valid = (depth > kNearestDepth) & (lateral.abs() < kLargestTangent * depth.unsqueeze(-1)).all(-1);
  const torch::Tensor valid = projected.valid.unsqueeze(-1);
  const torch::Tensor safe_depth = torch::where(valid, depth.unsqueeze(-1), torch::ones_like(lateral));
  torch::Tensor plane = torch::where(valid, lateral, torch::zeros_like(lateral)) / safe_depth;
  if (cameras.distorted) plane = Distort({rows(cameras.radial), rows(cameras.tangential)}, plane);

  const torch::Tensor focal_length = rows(cameras.focal_length);
  const torch::Tensor x = plane.select(-1, 0), y = plane.select(-1, 1);
  const torch::Tensor pixel =
      torch::stack({focal_length * x + rows(cameras.skew) * y, focal_length * rows(cameras.aspect) * y}, -1) +
      rows(cameras.principal_point);
  projected.pixel = torch::where(valid, pixel, torch::zeros_like(pixel));
  return projected;
}

torch::Tensor InsideImage(const CameraTensors& cameras, const torch::Tensor& pixel) {
  CheckLastDim(pixel, 2, "pixel");
  const torch::Tensor u = pixel.select(-1, 0), v = pixel.select(-1, 1);
  return (u >= 0) & (u <= static_cast<double>(cameras.width)) & (v >= 0) & (v <= static_cast<double>(cameras.height));
}

}  // namespace editnerf
