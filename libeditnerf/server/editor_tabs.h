// The tabs of browsers that look at the editor: each edits by itself.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "libeditnerf/editing/edit_session.h"
#include "libeditnerf/server/motion_job.h"

namespace editnerf {

struct EditorTab {
  explicit EditorTab(const std::shared_ptr<const EditableScene>& scene) : session(scene) {}
  std::mutex mutex;
  EditSession session;
  std::shared_ptr<MotionJob> motion;  // where a video was brought
  bool fresh = true;                  // nothing was edited yet: the page may know more than the server, started anew
  std::chrono::steady_clock::time_point used;
};

class EditorTabs {
 public:
  explicit EditorTabs(std::shared_ptr<const EditableScene> scene) : scene_(std::move(scene)) {}

  // Made where it is new; the one that was used least lately makes room. Throws DataError for an unfit name.
  std::shared_ptr<EditorTab> Of(const std::string& name);

  std::shared_ptr<MotionJob> MotionOf(const std::string& name);

 private:
  std::shared_ptr<const EditableScene> scene_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<EditorTab>> tabs_;
};

}  // namespace editnerf
