#include "libeditnerf/server/motion_job.h"

#include <algorithm>
#include <fstream>
#include <utility>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

// The first words of the messages; where the file lies on the server is nobody's business.
constexpr const char* kName = "video";

}  // namespace

MotionJob::MotionJob(std::shared_ptr<const EditableScene> scene)
    : scene_(std::move(scene)), video_(folder_ / "video") {}

MotionJob::~MotionJob() { Cancel(); }

void MotionJob::Receive(int64_t offset, int64_t size, const std::string& bytes) {
  const std::lock_guard<std::mutex> use(use_);
  const int64_t end = offset + static_cast<int64_t>(bytes.size());
  if (std::max(size, end) > kMaxBytes) {
    Throw<DataError>("video: it has {} MiB, and at most {} can be sent; shorten it, or make it smaller",
                     (std::max(size, end) + (1 << 20) - 1) >> 20, kMaxBytes >> 20);
  }
  if (offset != 0 && offset != received_) {
    Throw<DataError>("video: expected the piece at byte {}, found the one at {}; choose the file again", received_,
                     offset);
  }
  if (worker_.joinable()) {
    cancel_ = true;
    worker_.join();
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_ = {};
  }
  if (offset == 0) folder_.Restore();
  std::ofstream file(video_, std::ios::binary | (offset == 0 ? std::ios::trunc : std::ios::app));
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) {
    Throw<DataError>(
        "video: it cannot be kept; choose it again. Is the disk full, or was the temporary folder deleted?");
  }
  received_ = end;
}

torch::Tensor MotionJob::FirstFrame() const {
  try {
    return *VideoReader(video_).Next();
  } catch (const DataError&) {
    Throw<DataError>("video: this file cannot be read as a video (ffmpeg -i IN OUT.mp4 converts most)");
  }
}

void MotionJob::Start(const Pixel& point, const TransferOptions& options) {
  CheckKeyPoint(scene_->tracks, options.key_point);
  const std::lock_guard<std::mutex> use(use_);
  if (received_ == 0) Throw<DataError>("video: there is none yet; choose a file");
  if (worker_.joinable()) {
    cancel_ = true;
    worker_.join();
  }
  cancel_ = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_ = {};
    status_.state = MotionStatus::State::kRunning;
  }
  worker_ = std::thread([this, point, options] {
    try {
      Follow(point, options);
    } catch (const std::exception& error) {
      const std::lock_guard<std::mutex> lock(mutex_);
      status_.state = MotionStatus::State::kFailed;
      status_.message = error.what();
    }
  });
}

void MotionJob::Cancel() {
  const std::lock_guard<std::mutex> use(use_);
  cancel_ = true;
  if (worker_.joinable()) worker_.join();
}

MotionStatus MotionJob::Status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

void MotionJob::Follow(const Pixel& point, const TransferOptions& options) {
  FrameReader frames(video_);
  PointTrackOptions following;
  following.start = point;
  const PointTrack track = TrackPoint(frames, DisFlow(), following, kName, [this](int64_t done, int64_t total) {
    if (cancel_) Throw<Interrupted>("it was cancelled");
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.done = done;
    status_.total = std::max(done, total);
  });
  std::vector<Vec3> path = TransferMotion(track, scene_->tracks, options);
  double farthest = 0;
  for (const Vec3& position : path) {
    farthest = std::max(farthest, scene_->tracks.ReachOf(options.key_point, position).share);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.track = track.at;
  status_.path = std::move(path);
  status_.fps = track.fps;
  status_.farthest = farthest;
  status_.state = MotionStatus::State::kDone;
}

}  // namespace editnerf
