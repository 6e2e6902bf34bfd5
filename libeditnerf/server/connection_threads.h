// The threads that read requests and answer them, one for each connection that is open.
//
// A connection holds its thread also while it says nothing, or only half of a request, for which nobody needs the
// token. A pool of a fixed size would let a few dozen of those keep everybody else waiting; here a thread is begun
// whenever none is idle.
#pragma once

#include <httplib.h>

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace editnerf {

class ConnectionThreads : public httplib::TaskQueue {
 public:
  // Connections beyond `most` wait for one of the others to end.
  explicit ConnectionThreads(size_t most) : most_(most) {}

  using Accepted = decltype(std::declval<httplib::TaskQueue&>().enqueue(nullptr));  // void, or bool in newer versions
  Accepted enqueue(std::function<void()> connection) override {
    Add(std::move(connection));
    return Accepted(true);
  }
  void shutdown() override;  // answers what waits, and ends all threads

 private:
  void Add(std::function<void()> connection);
  void Loop();

  const size_t most_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> waiting_;
  size_t idle_ = 0;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace editnerf
