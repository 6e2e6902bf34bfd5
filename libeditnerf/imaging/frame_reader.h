// Frames in time order, wherever they are: in a video, a folder of images, or a scene folder.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/imaging/video_file.h"

namespace editnerf {

class FrameReader {
 public:
  // A video; a folder with images in name order, directly inside or in its folder "images"; or a scene folder (its
  // rgb/1x). Throws DataError naming it where it is missing or holds neither.
  explicit FrameReader(const std::filesystem::path& path);

  double fps() const { return video_ ? video_->fps() : 24; }  // images have none of their own
  int64_t frame_count() const;                                // as announced by a video; 0 where it does not say

  // The next frame, uint8 [H, W, 3] RGB; nothing at the end. Throws DataError naming the file that cannot be read or
  // has another size than the first.
  std::optional<torch::Tensor> Next();

 private:
  std::unique_ptr<VideoReader> video_;
  std::vector<std::filesystem::path> images_;
  size_t next_ = 0;
  int64_t width_ = 0, height_ = 0;
};

}  // namespace editnerf
