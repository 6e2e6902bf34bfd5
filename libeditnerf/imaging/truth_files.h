// Ground truth of synthetic scenes: the gt/ folder inside a scene folder.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// The ids of the edit frames: gt/edits.json, or none where that file is absent.
std::vector<std::string> ReadEditIds(const std::filesystem::path& folder);
void WriteEditIds(const std::filesystem::path& folder, const std::vector<std::string>& ids);

// Whether gt/motion.json is there.
bool HasTruth(const std::filesystem::path& folder);

// Motion, depth and masks of these frames in scene units, at height x width (nearest neighbour where the files are
// larger). Depth and masks stay undefined where their folder is absent. With S: scene = (world - center) * scale, a
// motion M of the file becomes S M S^-1: the same rotation R, the translation scale * (R center + t - center). Throws
// DataError naming the file and what was expected.
GroundTruth ReadTruth(const std::filesystem::path& folder, const std::vector<std::string>& ids,
                      const SceneTransform& transform, int64_t height, int64_t width);
void WriteTruth(const std::filesystem::path& folder, const std::vector<std::string>& ids, const GroundTruth& truth,
                const SceneTransform& transform);

}  // namespace editnerf
