// A sparse model of COLMAP: cameras, images and points3D as .bin or .txt, as every version from 3.0 on writes them.
//
// COLMAP's axes and pixel centres are this library's (OpenCV axes, centres at +0.5). Its camera models SIMPLE_PINHOLE,
// PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV map to Camera exactly; others are refused by name.
#pragma once

#include <cstdint>
#include <filesystem>

#include "libeditnerf/imaging/importers/imported_model.h"

namespace editnerf {

// Whether the folder holds cameras, images and points3D, all .bin or all .txt.
bool IsColmapModel(const std::filesystem::path& folder);

// Frames in the order of their names, image_path = image_folder / name. Binary files are preferred where both are
// there. Throws DataError naming the file that is missing, truncated or inconsistent; counts are checked against the
// file's size before anything is allocated.
ImportedModel ReadColmapModel(const std::filesystem::path& folder, const std::filesystem::path& image_folder);

// Number of registered images.
int64_t CountColmapImages(const std::filesystem::path& folder);

}  // namespace editnerf
