#include "libeditnerf/server/video_job.h"

#include <torch/types.h>

#include <exception>
#include <functional>
#include <memory>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/imaging/video_file.h"
#include "libeditnerf/pipeline/render_plan.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

PictureRequest RequestOf(const PlannedFrame& frame, int64_t row) {
  PictureRequest request;
  request.camera = frame.camera;
  request.row = row;
  request.passing = true;  // a video's states are close together
  if (!frame.states.key_points.defined()) return request;
  const auto known = frame.states.key_points[0].to(torch::kCPU, torch::kFloat64).contiguous();
  const auto at = known.accessor<double, 2>();
  for (int64_t n = 0; n < known.size(0); ++n) request.key_points.push_back({at[n][0], at[n][1], at[n][2]});
  return request;
}

// The row of the training frames that a frame of the edit names.
int64_t RowOf(const Scene& scene, const std::string& id) {
  for (size_t row = 0; row < scene.train.size(); ++row) {
    if (scene.frames[static_cast<size_t>(scene.train[row])].id == id) return static_cast<int64_t>(row);
  }
  Throw<DataError>("video: no training frame with id '{}'", id);
}

}  // namespace

VideoJob::VideoJob(RenderThread& thread, InteractiveRenderer& renderer) : thread_(thread), renderer_(renderer) {}

VideoJob::~VideoJob() {
  Cancel();
  if (worker_.joinable()) worker_.join();
}

void VideoJob::Start(const EditFile& edit) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (status_.state == VideoStatus::State::kRunning) {
    Throw<DataError>("video: one is being rendered already; cancel it, or wait for it");
  }
  if (worker_.joinable()) worker_.join();
  std::error_code ignored;
  fs::remove(path(), ignored);
  status_ = {VideoStatus::State::kRunning, 0, static_cast<int64_t>(edit.frames.size()), ""};
  cancel_ = false;
  worker_ = std::thread([this, edit] {
    try {
      Render(edit);
      Finish(cancel_ ? VideoStatus::State::kCancelled : VideoStatus::State::kDone);
    } catch (const std::exception& error) {
      LogWarning("video: {}", error.what());
      Finish(VideoStatus::State::kFailed, error.what());
    }
  });
}

void VideoJob::Cancel() { cancel_ = true; }

VideoStatus VideoJob::Status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

void VideoJob::Finish(VideoStatus::State state, const std::string& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.state = state;
  status_.message = message;
}

void VideoJob::Render(const EditFile& edit) {
  RenderJob job;
  const auto plan = [&](const std::function<bool()>&) { job = PlanEdit(renderer_.run(), edit); };
  if (!thread_.RunBehind(plan)) cancel_ = true;
  std::unique_ptr<VideoWriter> video;
  for (size_t i = 0; i < job.frames.size() && !cancel_; ++i) {
    const PictureRequest request = RequestOf(job.frames[i], RowOf(renderer_.run().scene, edit.frames[i].code_frame));
    torch::Tensor picture;  // undefined where Cancel was called, or the thread ends
    thread_.RunBehind([&](const std::function<bool()>& stale) {
      picture = renderer_.Render(request, [&] { return stale() || cancel_.load(); });
    });
    if (!picture.defined()) cancel_ = true;
    if (cancel_) return;
    if (!video) {
      folder_.Restore();
      video = std::make_unique<VideoWriter>(path(), picture.size(1), picture.size(0), edit.fps);
    }
    video->Write(picture);
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.done = static_cast<int64_t>(i + 1);
  }
  if (!cancel_ && video) video->Finish();
}

}  // namespace editnerf
