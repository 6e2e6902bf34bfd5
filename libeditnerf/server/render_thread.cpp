#include "libeditnerf/server/render_thread.h"

#include <algorithm>
#include <exception>
#include <utility>

namespace editnerf {

RenderThread::RenderThread() : thread_([this] { Loop(); }) {}

RenderThread::~RenderThread() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
    if (running_) running_->stale = true;
    for (auto* queue : {&waiting_, &behind_}) {
      for (const auto& item : *queue) item->done.set_value(false);
      queue->clear();
    }
  }
  wake_.notify_all();
  thread_.join();
}

bool RenderThread::Run(const std::string& lane, Work work) {
  auto item = std::make_shared<Item>();
  item->lane = lane;
  item->work = std::move(work);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto other = waiting_.begin(); other != waiting_.end();) {
      if ((*other)->lane != lane) {
        ++other;
        continue;
      }
      (*other)->done.set_value(false);
      other = waiting_.erase(other);
    }
    if (running_ && running_->lane == lane) running_->stale = true;
  }
  return Enqueue(std::move(item), &waiting_);
}

bool RenderThread::RunBehind(Work work) {
  auto item = std::make_shared<Item>();
  item->work = std::move(work);
  item->behind = true;
  return Enqueue(std::move(item), &behind_);
}

bool RenderThread::Enqueue(std::shared_ptr<Item> item, std::deque<std::shared_ptr<Item>>* queue) {
  std::future<bool> done = item->done.get_future();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stop_) return false;
    queue->push_back(std::move(item));
    wake_.notify_one();  // with the lock: the thread may run the item and be destroyed right after it is given back
  }
  return done.get();
}

void RenderThread::Loop() {
  for (;;) {
    std::shared_ptr<Item> item;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      running_.reset();
      wake_.wait(lock, [this] { return stop_ || !waiting_.empty() || !behind_.empty(); });
      if (stop_) return;
      auto& queue = waiting_.empty() ? behind_ : waiting_;
      item = queue.front();
      queue.pop_front();
      running_ = item;
    }
    RunItem(item);
  }
}

void RenderThread::RunItem(const std::shared_ptr<Item>& item) {
  try {
    item->work([this, &item] {
      if (item->behind) RunWaiting();
      return item->stale.load();
    });
    item->done.set_value(true);
  } catch (...) {
    item->done.set_exception(std::current_exception());
  }
}

// Within work that runs behind.
void RenderThread::RunWaiting() {
  std::shared_ptr<Item> behind;
  for (;;) {
    std::shared_ptr<Item> item;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!behind) behind = running_;
      if (stop_) behind->stale = true;
      if (waiting_.empty()) {
        running_ = behind;
        return;
      }
      item = waiting_.front();
      waiting_.pop_front();
      running_ = item;
    }
    RunItem(item);
  }
}

}  // namespace editnerf
