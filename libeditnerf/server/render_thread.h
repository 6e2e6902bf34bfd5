// The one thread that renders, and the order in which it takes what it is asked for.
//
// Pictures for people come first; of each lane (a browser tab), only the newest is of any use: an older one that waits
// is dropped, and one that is being rendered is told that it is stale. Work that runs behind (frames of a
// video) is taken when nobody waits, and never dropped; whenever it asks whether it is still wanted, it lets pictures
// for people go first.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace editnerf {

class RenderThread {
 public:
  // May ask from time to time whether its result is still wanted, and end early where it is not.
  using Work = std::function<void(const std::function<bool()>& stale)>;

  RenderThread();
  ~RenderThread();  // drops what waits, and ends after the work in hand

  // Returns when the work is done (true) or dropped (false); an exception of the work is rethrown here.
  bool Run(const std::string& lane, Work work);
  bool RunBehind(Work work);

 private:
  struct Item {
    std::string lane;
    Work work;
    bool behind = false;
    std::promise<bool> done;
    std::atomic<bool> stale{false};
  };

  bool Enqueue(std::shared_ptr<Item> item, std::deque<std::shared_ptr<Item>>* queue);
  void Loop();
  void RunItem(const std::shared_ptr<Item>& item);
  void RunWaiting();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::shared_ptr<Item>> waiting_, behind_;
  std::shared_ptr<Item> running_;
  bool stop_ = false;
  std::thread thread_;  // last: it uses everything above
};

}  // namespace editnerf
