// The raw records of a COLMAP model, before they become cameras. Internal to the importer.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf::colmap {

struct CameraRecord {
  std::string model;  // "SIMPLE_RADIAL", ...
  int64_t width = 0, height = 0;
  std::vector<double> parameters;
};

struct ImageRecord {
  std::string name;
  std::array<double, 4> rotation = {1, 0, 0, 0};  // camera_from_world, w x y z
  Vec3 translation;
  int64_t camera = 0;
  std::vector<int64_t> points;  // ids of the observed points, -1 left out
};

struct PointRecord {
  Vec3 position;
  double error = 0;  // pixels
};

struct Files {
  std::map<int64_t, CameraRecord> cameras;
  std::vector<ImageRecord> images;
  std::map<int64_t, PointRecord> points;
};

// cameras.bin, images.bin and points3D.bin, or the same as .txt. Throw DataError naming the file.
Files ReadBinary(const std::filesystem::path& folder);
Files ReadText(const std::filesystem::path& folder);

}  // namespace editnerf::colmap
