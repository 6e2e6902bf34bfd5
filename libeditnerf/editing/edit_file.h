// The edit file of enf-render: which key point positions, camera and codes every output frame has (docs/edit-files.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

struct EditFrame {
  // By key point index, scene units. Those that are not given, or lie beyond the end, are where the code frame has
  // them.
  std::vector<std::optional<Vec3>> key_points;
  std::optional<Camera> camera;  // WORLD units, as in camera files; otherwise camera_frame is set
  std::string camera_frame;      // id of a scene frame whose camera is used
  std::string code_frame;  // id of the training frame whose codes are used; empty: the one with the nearest key points
};

struct EditFile {
  double fps = 24;
  int64_t width = 0, height = 0;  // of the output; 0: as the cameras say
  std::vector<EditFrame> frames;  // at least one
};

// `name` starts the error messages. A frame without a camera has the camera of the frame before it; the first one needs
// one. Throws DataError naming the file, the place in it ("frames[3].key_points[0]"), what was found and what was
// expected, also for unknown keys and for frames that name neither a code frame nor a key point.
EditFile ParseEditFile(const std::string& text, const std::string& name);
EditFile ReadEditFile(const std::filesystem::path& path);

// What ParseEditFile reads back unchanged; cameras are written where they change. Throws DataError for an edit that
// ParseEditFile would refuse.
std::string WriteEditFile(const EditFile& edit);

}  // namespace editnerf
