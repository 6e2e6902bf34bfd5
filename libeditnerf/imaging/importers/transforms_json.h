// NeRF / D-NeRF transforms*.json (also as instant-ngp and nerfstudio write them).
//
// transform_matrix is camera-to-world with OpenGL axes (x right, y up, z backwards). Intrinsics are fl_x, fl_y, cx, cy,
// w, h, k1, k2, k3, p1, p2, or camera_angle_x alone, at the top or per frame; missing sizes come from the image, a
// missing principal point is the centre.
#pragma once

#include <filesystem>

#include "libeditnerf/imaging/importers/imported_model.h"

namespace editnerf {

// Frames in the order of "time" where every frame has one, otherwise in the file's order. Image paths are relative to
// the file; a missing ending means .png. Throws DataError naming the file, the frame and what was expected.
ImportedModel ReadTransformsJson(const std::filesystem::path& path);

}  // namespace editnerf
