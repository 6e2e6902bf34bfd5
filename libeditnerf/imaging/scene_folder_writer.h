// Writing a scene folder in parts, for a scene whose images are already in place or too many to hold in memory.
#pragma once

#include <filesystem>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// Removes what an earlier scene left in the folder and a reader would take for the new one's: dataset.json (so that the
// folder does not pass for a scene until it is whole), downsampled images, points, key points, depth, flow,
// ground truth.
void RemoveStaleSceneFiles(const std::filesystem::path& folder);

// Everything of WriteSceneFolder but the images, which must lie in rgb/1x; scene.images is not looked at. dataset.json
// is written last. Throws DataError naming the file.
void WriteSceneDescription(const Scene& scene, const std::filesystem::path& folder);

}  // namespace editnerf
