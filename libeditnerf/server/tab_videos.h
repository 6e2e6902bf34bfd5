// The videos of the editor's tabs: each has its own, and one at a time is rendered.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "libeditnerf/server/video_job.h"

namespace editnerf {

class TabVideos {
 public:
  // Both references must outlive it.
  TabVideos(RenderThread& thread, InteractiveRenderer& renderer) : thread_(thread), renderer_(renderer) {}

  // Begins to render the tab's video, in the place of its last one. Returns why it cannot be done now, or nothing.
  // Throws DataError where there is no place for a temporary folder.
  std::string Start(const std::string& tab, const EditFile& edit);

  // The tab's video; the one that was started last, by whichever tab, for an empty name. Null where there is none.
  std::shared_ptr<VideoJob> Of(const std::string& tab) const;

 private:
  RenderThread& thread_;
  InteractiveRenderer& renderer_;
  mutable std::mutex mutex_;
  std::deque<std::pair<std::string, std::shared_ptr<VideoJob>>> videos_;  // as they were started; only the last runs
};

}  // namespace editnerf
