#include "libeditnerf/imaging/video_file.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

constexpr double kDefaultFps = 30;
constexpr double kMostlyThere = 0.9;  // of the announced frames: the count of some containers is an estimate

}  // namespace

struct VideoReader::Impl {
  fs::path path;
  cv::VideoCapture capture;
  cv::Mat frame;  // the frame that was grabbed last
  double fps = kDefaultFps;
  int64_t count = 0, read = 0;
  bool pending = false;  // the first frame is decoded when the file is opened

  bool Advance() {
    if (pending) {
      pending = false;
    } else if (!capture.grab()) {
      if (static_cast<double>(read) < kMostlyThere * static_cast<double>(count)) {
        Throw<DataError>("{}: ends after {} of {} frames; the file is truncated or damaged", path.string(), read,
                         count);
      }
      return false;
    }
    ++read;
    return true;
  }
};

VideoReader::VideoReader(const fs::path& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  if (!fs::exists(path)) Throw<DataError>("{}: no such file", path.string());
  cv::VideoCapture& capture = impl_->capture;
  try {
    // Not any backend: another one would read "frame_001.png" as a numbered sequence.
    capture.open(path.string(), cv::CAP_FFMPEG);
  } catch (const cv::Exception&) {
    capture.release();
  }
  if (!capture.isOpened()) {
    Throw<DataError>(
        "{}: cannot be opened as a video; it is damaged, truncated, or of a kind that is not supported "
        "(ffmpeg -i IN OUT.mp4 converts most)",
        path.string());
  }
  if (!capture.grab() || !capture.retrieve(impl_->frame) || impl_->frame.empty()) {
    Throw<DataError>("{}: its first frame cannot be decoded; the video is damaged or of a kind that is not supported",
                     path.string());
  }
  impl_->pending = true;
  const double fps = capture.get(cv::CAP_PROP_FPS), count = capture.get(cv::CAP_PROP_FRAME_COUNT);
  if (std::isfinite(fps) && fps > 0 && fps < 1000) impl_->fps = fps;
  if (std::isfinite(count) && count > 0 && count < 1e9) impl_->count = static_cast<int64_t>(count);
}

VideoReader::~VideoReader() = default;

double VideoReader::fps() const { return impl_->fps; }
int64_t VideoReader::frame_count() const { return impl_->count; }
int64_t VideoReader::width() const { return impl_->frame.cols; }
int64_t VideoReader::height() const { return impl_->frame.rows; }

bool VideoReader::Skip() { return impl_->Advance(); }

std::optional<torch::Tensor> VideoReader::Next() {
  const bool first = impl_->pending;
  if (!impl_->Advance()) return std::nullopt;
  cv::Mat& frame = impl_->frame;
  if (!first && (!impl_->capture.retrieve(frame) || frame.empty())) {
    Throw<DataError>("{}: frame {} cannot be decoded", impl_->path.string(), impl_->read - 1);
  }
  torch::Tensor image = torch::empty({frame.rows, frame.cols, 3}, torch::kUInt8);
  cv::Mat rgb(frame.rows, frame.cols, CV_8UC3, image.data_ptr<uint8_t>());
  cv::cvtColor(frame, rgb, cv::COLOR_BGR2RGB);
  return image;
}

void ForEachVideoFrame(const fs::path& path, int64_t max_frames,
                       const std::function<void(int64_t, int64_t, const torch::Tensor&)>& visit) {
  if (max_frames < 1) Throw<ConfigError>("max_frames: expected at least 1, found {}", max_frames);
  VideoReader reader(path);
  int64_t count = reader.frame_count();
  if (count == 0) {
    VideoReader counter(path);
    while (counter.Skip()) ++count;
  }
  const int64_t wanted = std::min(count, max_frames);
  int64_t taken = 0;
  for (int64_t i = 0;; ++i) {
    if (taken == wanted || i != taken * count / wanted) {
      if (!reader.Skip()) break;
      continue;
    }
    const auto frame = reader.Next();
    if (!frame) break;
    visit(taken++, wanted, *frame);
  }
}

std::vector<torch::Tensor> ReadVideoFrames(const fs::path& path, int64_t max_frames) {
  std::vector<torch::Tensor> frames;
  ForEachVideoFrame(path, max_frames, [&](int64_t, int64_t, const torch::Tensor& frame) { frames.push_back(frame); });
  return frames;
}

struct VideoWriter::Impl {
  fs::path path, temporary;
  cv::VideoWriter writer;
  int64_t width = 0, height = 0, written = 0;
  bool finished = false;
};

VideoWriter::VideoWriter(const fs::path& path, int64_t width, int64_t height, double fps)
    : impl_(std::make_unique<Impl>()) {
  if (width < 1 || height < 1 || !(fps > 0)) {
    Throw<ShapeError>("{}: expected a positive size and rate, found {} x {} at {} frames per second", path.string(),
                      width, height, fps);
  }
  impl_->path = path;
  impl_->temporary = path.string() + ".partial.mp4";  // the ending selects the container
  impl_->width = width;
  impl_->height = height;
  const cv::Size even(static_cast<int>(width + width % 2), static_cast<int>(height + height % 2));
  for (const char* codec : {"avc1", "mp4v"}) {
    const int fourcc = cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]);
    try {
      if (impl_->writer.open(impl_->temporary.string(), cv::CAP_FFMPEG, fourcc, fps, even)) return;
    } catch (const cv::Exception&) {
      impl_->writer.release();
    }
  }
  std::error_code ignored;
  fs::remove(impl_->temporary, ignored);
  Throw<DataError>("{}: cannot be opened for writing a video; check that its folder exists and may be written",
                   path.string());
}

VideoWriter::~VideoWriter() {
  if (impl_->finished) return;
  impl_->writer.release();
  std::error_code ignored;
  fs::remove(impl_->temporary, ignored);
}

void VideoWriter::Write(const torch::Tensor& frame) {
  CheckShape(frame, {impl_->height, impl_->width, 3}, "video frame");
  if (frame.scalar_type() != torch::kUInt8) Throw<ShapeError>("video frame: expected 8-bit unsigned values");
  const torch::Tensor pixels = frame.to(torch::kCPU).contiguous();
  const cv::Mat rgb(static_cast<int>(impl_->height), static_cast<int>(impl_->width), CV_8UC3,
                    pixels.data_ptr<uint8_t>());
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  cv::copyMakeBorder(bgr, bgr, 0, static_cast<int>(impl_->height % 2), 0, static_cast<int>(impl_->width % 2),
                     cv::BORDER_REPLICATE);
  impl_->writer.write(bgr);
  ++impl_->written;
}

void VideoWriter::Finish() {
  if (impl_->finished) return;
  impl_->writer.release();
  // The encoder reports no errors; what it wrote is looked at instead. The index of an MP4 comes last.
  int64_t found = 0;
  if (impl_->written > 0) {
    cv::VideoCapture check;
    try {
      if (check.open(impl_->temporary.string(), cv::CAP_FFMPEG)) {
        found = static_cast<int64_t>(check.get(cv::CAP_PROP_FRAME_COUNT));
      }
    } catch (const cv::Exception&) {
      found = 0;
    }
  }
  if (found < impl_->written || impl_->written == 0) {
    Throw<DataError>("{}: the video is incomplete, {} of {} frames; is the disk full?", impl_->path.string(), found,
                     impl_->written);
  }
  std::error_code code;
  fs::rename(impl_->temporary, impl_->path, code);
  if (code) Throw<DataError>("{}: cannot be put in place: {}", impl_->path.string(), code.message());
  impl_->finished = true;
}

}  // namespace editnerf
