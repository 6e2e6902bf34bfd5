// A video that a tab brought, and a point of it that is followed in the background to drive a key point.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "libeditnerf/editing/edit_session.h"
#include "libeditnerf/editing/motion_transfer.h"
#include "libeditnerf/server/temporary_folder.h"

namespace editnerf {

struct MotionStatus {
  enum class State { kNone, kRunning, kDone, kFailed };
  State state = State::kNone;
  int64_t done = 0, total = 0;  // frames
  std::string message;          // why it failed
  std::vector<Pixel> track;     // pixels of the video
  std::vector<Vec3> path;       // where the key point goes
  double fps = 0;
  double farthest = 0;  // from where training saw it, as a share of its range
};

class MotionJob {
 public:
  static constexpr int64_t kMaxBytes = 200 << 20;  // of a video

  explicit MotionJob(std::shared_ptr<const EditableScene> scene);  // makes a temporary folder, which goes with it
  ~MotionJob();

  // A piece of the video's file, which has `size` bytes in all; pieces in order, one at 0 begins a new video. Throws
  // DataError for a piece that does not follow the last one, and for more than kMaxBytes, at the first piece if it is
  // honest.
  void Receive(int64_t offset, int64_t size, const std::string& bytes);
  torch::Tensor FirstFrame() const;  // throws DataError where what was received is not a video

  // The last motion is forgotten. What goes wrong while following is in the status. Throws DataError for a key point
  // that does not exist.
  void Start(const Pixel& point, const TransferOptions& options);
  void Cancel();  // and waits for the end, a frame's time

  MotionStatus Status() const;

 private:
  void Follow(const Pixel& point, const TransferOptions& options);

  std::shared_ptr<const EditableScene> scene_;
  TemporaryFolder folder_;
  std::filesystem::path video_;
  int64_t received_ = 0;
  mutable std::mutex mutex_;  // of the status; everything else is used under use_
  std::mutex use_;
  MotionStatus status_;
  std::atomic<bool> cancel_{false};
  std::thread worker_;
};

}  // namespace editnerf
