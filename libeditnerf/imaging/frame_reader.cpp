#include "libeditnerf/imaging/frame_reader.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/importers/llff.h"

namespace editnerf {
namespace fs = std::filesystem;

FrameReader::FrameReader(const fs::path& path) {
  if (!fs::is_directory(path)) {
    video_ = std::make_unique<VideoReader>(path);
    return;
  }
  for (const fs::path& folder : {path, path / "images", path / "rgb" / "1x"}) {
    if (images_.empty() && fs::is_directory(folder)) images_ = ListImages(folder);
  }
  if (images_.empty()) {
    Throw<DataError>("{}: expected a video, a folder of images (.png, .jpg, ...) or a scene folder, found no image",
                     path.string());
  }
}

int64_t FrameReader::frame_count() const {
  return video_ ? video_->frame_count() : static_cast<int64_t>(images_.size());
}

std::optional<torch::Tensor> FrameReader::Next() {
  if (video_) return video_->Next();
  if (next_ >= images_.size()) return std::nullopt;
  torch::Tensor image = ReadImage(images_[next_]);
  if (next_ == 0) {
    height_ = image.size(0);
    width_ = image.size(1);
  }
  if (image.size(0) != height_ || image.size(1) != width_) {
    Throw<DataError>("{}: {} x {} pixels, expected {} x {} as in {}; all frames must have one size",
                     images_[next_].string(), image.size(1), image.size(0), width_, height_,
                     images_[0].filename().string());
  }
  ++next_;
  return image;
}

}  // namespace editnerf
