// LLFF's poses_bounds.npy: one row of 17 numbers per image.
//
// A row holds a 3 x 5 matrix (row-major) and the nearest and farthest depth. The matrix's columns are the camera's
// downward, rightward and backward axes in the world, its position, and (height, width, focal length).
#pragma once

#include <filesystem>

#include "libeditnerf/imaging/importers/imported_model.h"

namespace editnerf {

// Rows belong to the images of `image_folder` in name order. Throws DataError naming the file and what was expected.
ImportedModel ReadLlffPoses(const std::filesystem::path& path, const std::filesystem::path& image_folder);

// Image files directly inside a folder, in name order (file2 before file10 only if the names are padded so).
std::vector<std::filesystem::path> ListImages(const std::filesystem::path& folder);

}  // namespace editnerf
