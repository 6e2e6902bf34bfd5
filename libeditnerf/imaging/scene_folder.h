// The scene folder: Nerfies / HyperNeRF layout, with EditableNeRF's additions and ground truth (docs/formats.md).
#pragma once

#include <filesystem>

#include "libeditnerf/config/config.h"
#include "libeditnerf/scene/scene.h"

namespace editnerf {

// Reads a scene folder: cameras to scene units, images at the factor that `config` asks for (read from rgb/<factor>x,
// or area-averaged from rgb/1x in memory), splits, points.npy and gt/ where present. Where the folder names no
// validation frames, config.hold_out decides which training frames are kept from training.
// Throws DataError naming the file and what was expected.
Scene ReadSceneFolder(const std::filesystem::path& folder, const DataConfig& config);

// Writes the layout at full size (rgb/1x), with ground truth where the scene has it. Existing files are replaced.
void WriteSceneFolder(const Scene& scene, const std::filesystem::path& folder);

}  // namespace editnerf
