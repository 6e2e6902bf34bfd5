// Video files frame by frame.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace editnerf {

class VideoReader {
 public:
  // Throws DataError naming the file where it is missing, is no video, or its first frame cannot be decoded.
  explicit VideoReader(const std::filesystem::path& path);
  ~VideoReader();

  double fps() const;           // 30 where the file does not say
  int64_t frame_count() const;  // as announced by the file; 0 where it does not say
  int64_t width() const;
  int64_t height() const;

  // The next frame, uint8 [H, W, 3] RGB; nothing at the end. Throws DataError where the video ends before nine tenths
  // of the frames that it announces (truncated).
  std::optional<torch::Tensor> Next();
  bool Skip();  // the same without the conversion; false at the end

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Calls visit(index, wanted, frame) for at most max_frames (> 0) frames, evenly spaced in time and including the first;
// index counts them from 0, `wanted` is how many there will be. Throws as VideoReader does.
void ForEachVideoFrame(const std::filesystem::path& path, int64_t max_frames,
                       const std::function<void(int64_t index, int64_t wanted, const torch::Tensor& frame)>& visit);

// The same frames in memory.
std::vector<torch::Tensor> ReadVideoFrames(const std::filesystem::path& path, int64_t max_frames);

// MP4: H.264 where OpenCV has an encoder for it, MPEG-4 otherwise. Odd sides get one more row or column, a copy of the
// last. Frames go to a temporary file beside `path`, which Finish puts in place; without Finish nothing is left behind.
class VideoWriter {
 public:
  // width, height > 0, fps > 0. Throws DataError naming the file where it cannot be written.
  VideoWriter(const std::filesystem::path& path, int64_t width, int64_t height, double fps);
  ~VideoWriter();

  // uint8 [height, width, 3] RGB. Throws ShapeError.
  void Write(const torch::Tensor& frame);

  // Throws DataError where the file turns out incomplete (a full disk).
  void Finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace editnerf
