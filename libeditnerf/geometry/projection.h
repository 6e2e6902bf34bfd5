// Projection of points with validity: what the motion and geometry losses stand on.
#pragma once

#include <torch/types.h>

#include "libeditnerf/geometry/camera_tensors.h"

namespace editnerf {

// P points. Values and gradients are finite for every input, NaN and infinity included.
struct ProjectedPoints {
  torch::Tensor pixel;             // [P, 2], Pi; 0 where invalid
  torch::Tensor depth_along_axis;  // [P], scene units; may be negative where invalid
  torch::Tensor distance;          // [P], Phi: to the camera centre, scene units; also behind the camera
  torch::Tensor valid;             // [P] bool
};

// frame [P] int64, rows of `cameras`; point [P, 3], scene units. Differentiable in `point`.
//
// Invalid are points at or behind the camera plane (depth <= 1e-6), points more than 89.9 degrees off the axis (tangent
// above 1e3), and points with a coordinate that is not finite or beyond 1e9; for the last, depth and distance are 0.
// The agreement with Project (geometry/camera.h) is exact otherwise. Throws ShapeError.
ProjectedPoints ProjectPoints(const CameraTensors& cameras, const torch::Tensor& frame, const torch::Tensor& point);

// [P] bool: whether a pixel position [P, 2] lies in the image, 0 <= u <= width and 0 <= v <= height.
torch::Tensor InsideImage(const CameraTensors& cameras, const torch::Tensor& pixel);

}  // namespace editnerf
