// What every importer returns: cameras with their images, and points where the source has them. World units.
#pragma once

#include <torch/types.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

struct ImportedFrame {
  std::string name;                  // as the source calls it, usually a file name
  std::filesystem::path image_path;  // empty where the source does not say
  Camera camera;
  double time =
      std::numeric_limits<double>::quiet_NaN();  // as the source has it; NaN: the order of frames is all there is
  std::vector<int64_t> seen_points;              // rows of `points` that this frame observed
  double near = 0, far = 0;                      // distances that bound what it sees; 0: unknown
};

struct ImportedModel {
  std::vector<ImportedFrame> frames;  // in time order; by name where there are no times
  torch::Tensor points;               // [P, 3] float64; undefined where the source has none
  double mean_reprojection_error = std::numeric_limits<double>::quiet_NaN();  // pixels, mean over the points
};

// The rotation next to `m` by Gram-Schmidt on its rows; importers use it against the rounding of text files.
// Throws DataError naming `where` when m is further than 1e-2 from a rotation.
Mat3 NearestRotation(const Mat3& m, const std::string& where);

}  // namespace editnerf
