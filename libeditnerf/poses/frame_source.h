// The frames of a video or of image files, copied into a scene folder as rgb/1x/ID.png.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace editnerf {

struct CopiedFrames {
  std::vector<std::string> ids;    // "000000", ... in time order
  std::vector<std::string> names;  // of the image files; empty strings for a video
  int64_t width = 0, height = 0;
};

// All of them, in this order. Throws DataError naming the file that cannot be read or has another size than the first.
CopiedFrames CopyImages(const std::vector<std::filesystem::path>& images, const std::filesystem::path& scene_folder);

// At most max_frames, evenly spaced.
CopiedFrames CopyVideoFrames(const std::filesystem::path& video, int64_t max_frames,
                             const std::filesystem::path& scene_folder);

// At most max_frames of them, evenly spaced.
std::vector<std::filesystem::path> EvenlySpaced(const std::vector<std::filesystem::path>& images, int64_t max_frames);

}  // namespace editnerf
