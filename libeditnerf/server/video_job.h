// A video of an edit, rendered in the background while people go on editing.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/pipeline/interactive_renderer.h"
#include "libeditnerf/server/render_thread.h"
#include "libeditnerf/server/temporary_folder.h"

namespace editnerf {

struct VideoStatus {
  enum class State { kNone, kRunning, kDone, kCancelled, kFailed };
  State state = State::kNone;
  int64_t done = 0, total = 0;  // frames
  std::string message;          // why it failed
};

class VideoJob {
 public:
  // The video is kept in a temporary folder, which goes with this object. Both references must outlive it.
  VideoJob(RenderThread& thread, InteractiveRenderer& renderer);
  ~VideoJob();

  // Every frame of the edit names a code frame. Throws DataError while it is rendering already; whatever goes wrong
  // later is in the status.
  void Start(const EditFile& edit);
  void Cancel();  // returns at once; what was rendered so far is thrown away

  VideoStatus Status() const;
  std::filesystem::path path() const { return folder_ / "edited.mp4"; }  // there when the state is kDone

 private:
  void Render(const EditFile& edit);
  void Finish(VideoStatus::State state, const std::string& message = "");

  RenderThread& thread_;
  InteractiveRenderer& renderer_;
  TemporaryFolder folder_;
  mutable std::mutex mutex_;
  VideoStatus status_;
  std::atomic<bool> cancel_{false};
  std::thread worker_;
};

}  // namespace editnerf
