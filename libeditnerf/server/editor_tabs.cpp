#include "libeditnerf/server/editor_tabs.h"

#include <algorithm>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr size_t kMaxTabs = 32;
constexpr size_t kMaxName = 64;

}  // namespace

std::shared_ptr<EditorTab> EditorTabs::Of(const std::string& name) {
  if (name.empty() || name.size() > kMaxName) {
    Throw<DataError>("request: tab: expected a name of 1 to {} characters, found {}", kMaxName,
                     name.empty() ? "none" : fmt::format("one of {}", name.size()));
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  auto found = tabs_.find(name);
  if (found == tabs_.end()) {
    if (tabs_.size() >= kMaxTabs) {
      tabs_.erase(std::min_element(tabs_.begin(), tabs_.end(),
                                   [](const auto& a, const auto& b) { return a.second->used < b.second->used; }));
    }
    found = tabs_.emplace(name, std::make_shared<EditorTab>(scene_)).first;
  }
  found->second->used = std::chrono::steady_clock::now();
  return found->second;
}

std::shared_ptr<MotionJob> EditorTabs::MotionOf(const std::string& name) {
  const std::shared_ptr<EditorTab> tab = Of(name);
  const std::lock_guard<std::mutex> lock(tab->mutex);
  if (!tab->motion) tab->motion = std::make_shared<MotionJob>(scene_);
  return tab->motion;
}

}  // namespace editnerf
