#include "libeditnerf/geometry/rays.h"

#include "libeditnerf/base/shape.h"
#include "libeditnerf/geometry/distortion.h"

namespace editnerf {

Rays RaysThroughPixels(const CameraTensors& cameras, const torch::Tensor& frame, const torch::Tensor& pixel) {
  CheckShape(frame, {kAny}, "frame");
  CheckShape(pixel, {frame.size(0), 2}, "pixel");
  const auto rows = [&frame](const torch::Tensor& table) { return table.index_select(0, frame); };
  const torch::Tensor offset = pixel.to(cameras.position.scalar_type()) - rows(cameras.principal_point);
  const torch::Tensor focal_length = rows(cameras.focal_length);
  const torch::Tensor y = offset.select(-1, 1) / (focal_length * rows(cameras.aspect));
  const torch::Tensor x = (offset.select(-1, 0) - rows(cameras.skew) * y) / focal_length;
  torch::Tensor plane = torch::stack({x, y}, -1);
  if (cameras.distorted) plane = Undistort({rows(cameras.radial), rows(cameras.tangential)}, plane);
  const torch::Tensor in_camera = torch::cat({plane, torch::ones_like(plane.narrow(-1, 0, 1))}, -1);
  // Rows of the orientation are the camera's axes in the scene: scene_from_camera is the sum over them.
  const torch::Tensor in_scene = (rows(cameras.orientation) * in_camera.unsqueeze(-1)).sum(-2);
  return {rows(cameras.position), in_scene / in_scene.norm(2, -1, true)};
}

}  // namespace editnerf
