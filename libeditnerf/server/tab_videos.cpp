#include "libeditnerf/server/tab_videos.h"

#include <algorithm>
#include <cstddef>

namespace editnerf {
namespace {

constexpr size_t kMaxVideos = 8;  // kept at a time; they lie in temporary folders

}  // namespace

std::string TabVideos::Start(const std::string& tab, const EditFile& edit) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!videos_.empty() && videos_.back().second->Status().state == VideoStatus::State::kRunning) {
    if (videos_.back().first == tab) return "a video is being rendered already; cancel it, or wait for it";
    return "another tab is rendering a video; wait for it, or cancel it there";
  }
  auto video = std::make_shared<VideoJob>(thread_, renderer_);
  video->Start(edit);
  videos_.erase(std::remove_if(videos_.begin(), videos_.end(), [&](const auto& other) { return other.first == tab; }),
                videos_.end());
  if (videos_.size() >= kMaxVideos) videos_.pop_front();
  videos_.emplace_back(tab, std::move(video));
  return "";
}

std::shared_ptr<VideoJob> TabVideos::Of(const std::string& tab) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto video = videos_.rbegin(); video != videos_.rend(); ++video) {
    if (tab.empty() || video->first == tab) return video->second;
  }
  return nullptr;
}

}  // namespace editnerf
