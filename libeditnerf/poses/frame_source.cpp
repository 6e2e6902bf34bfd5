#include "libeditnerf/poses/frame_source.h"

#include <algorithm>
#include <mutex>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/video_file.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

std::string IdOf(int64_t index) { return fmt::format("{:06d}", index); }

fs::path PrepareFolder(const fs::path& scene_folder) {
  const fs::path folder = scene_folder / "rgb" / "1x";
  std::error_code ignored;
  fs::remove_all(folder, ignored);  // frames of an earlier scene
  MakeFolder(folder);
  return folder;
}

}  // namespace

CopiedFrames CopyImages(const std::vector<fs::path>& images, const fs::path& scene_folder) {
  CopiedFrames frames;
  if (images.empty()) return frames;
  const fs::path folder = PrepareFolder(scene_folder);
  const torch::Tensor first = ReadImage(images[0]);
  frames.height = first.size(0);
  frames.width = first.size(1);
  for (size_t i = 0; i < images.size(); ++i) {
    frames.ids.push_back(IdOf(static_cast<int64_t>(i)));
    frames.names.push_back(images[i].filename().string());
  }
  const auto count = static_cast<int64_t>(images.size());
  Progress progress("copying images", static_cast<double>(count));
  std::mutex mutex;
  int64_t done = 0;
  ParallelFor(count, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      if (InterruptRequested()) Throw<Interrupted>("interrupted while copying images");
      const fs::path& path = images[static_cast<size_t>(i)];
      const torch::Tensor image = ReadImage(path);
      if (image.size(0) != frames.height || image.size(1) != frames.width) {
        Throw<DataError>("{}: {} x {} pixels, expected {} x {} as in {}; all frames must have one size", path.string(),
                         image.size(1), image.size(0), frames.width, frames.height, images[0].filename().string());
      }
      WritePng(folder / (IdOf(i) + ".png"), image);
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Update(static_cast<double>(++done));
    }
  });
  progress.Finish();
  return frames;
}

CopiedFrames CopyVideoFrames(const fs::path& video, int64_t max_frames, const fs::path& scene_folder) {
  CopiedFrames frames;
  const fs::path folder = PrepareFolder(scene_folder);
  Progress progress("reading video", 1);
  ForEachVideoFrame(video, max_frames, [&](int64_t index, int64_t wanted, const torch::Tensor& frame) {
    if (InterruptRequested()) Throw<Interrupted>("interrupted while reading the video");
    if (index == 0) {
      frames.height = frame.size(0);
      frames.width = frame.size(1);
    } else if (frame.size(0) != frames.height || frame.size(1) != frames.width) {
      Throw<DataError>("{}: changes its size from {} x {} to {} x {} pixels; all frames must have one size",
                       video.string(), frames.width, frames.height, frame.size(1), frame.size(0));
    }
    WritePng(folder / (IdOf(index) + ".png"), frame);
    frames.ids.push_back(IdOf(index));
    frames.names.emplace_back();
    progress.Update(static_cast<double>(index + 1) / static_cast<double>(wanted));
  });
  progress.Finish();
  return frames;
}

std::vector<fs::path> EvenlySpaced(const std::vector<fs::path>& images, int64_t max_frames) {
  const auto count = static_cast<int64_t>(images.size());
  if (count <= max_frames) return images;
  std::vector<fs::path> chosen;
  for (int64_t i = 0; i < max_frames; ++i) chosen.push_back(images[static_cast<size_t>(i * count / max_frames)]);
  return chosen;
}

}  // namespace editnerf
