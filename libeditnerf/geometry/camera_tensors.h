// The cameras of all frames as tensors, one row per frame, for batches of rays and points that mix frames.
//
// The same model, frames and units as geometry/camera.h; orientation is camera_from_scene.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

struct CameraTensors {
  torch::Tensor orientation;      // [F, 3, 3]
  torch::Tensor position;         // [F, 3]
  torch::Tensor focal_length;     // [F], pixels along x
  torch::Tensor aspect;           // [F], focal length along y over focal length along x
  torch::Tensor skew;             // [F], pixels
  torch::Tensor principal_point;  // [F, 2], pixels
  torch::Tensor radial;           // [F, 3]
  torch::Tensor tangential;       // [F, 2]
  bool distorted = false;         // whether any camera has distortion; otherwise its terms are skipped
  int64_t width = 0, height = 0;  // pixels, common to all frames

  int64_t size() const { return position.size(0); }
  CameraTensors To(torch::Dtype dtype, torch::Device device) const;
};

// Throws DataError when there is no camera, or when the image sizes differ.
CameraTensors StackCameras(const std::vector<Camera>& cameras, torch::Dtype dtype = torch::kFloat32,
                           torch::Device device = torch::kCPU);

}  // namespace editnerf
