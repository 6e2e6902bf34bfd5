#include "libeditnerf/server/render_thread.h"

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/catch.h"

using namespace editnerf;

namespace {

using Stale = std::function<bool()>;

// Work runs behind that does nothing but ask whether it is still wanted, until `picture` has run for a person or half a
// minute is over. Whether the picture ran meanwhile.
bool RunsMeanwhile(RenderThread* thread, const RenderThread::Work& picture) {
  std::promise<void> begun;
  std::future<bool> person = std::async(std::launch::async, [&] {
    begun.get_future().wait();
    try {
      return thread->Run("tab", picture);
    } catch (const std::runtime_error&) {
      return true;
    }
  });
  bool meanwhile = false;
  thread->RunBehind([&](const Stale& stale) {
    begun.set_value();
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!meanwhile && !stale() && std::chrono::steady_clock::now() < end) {
      meanwhile = person.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    }
  });
  return person.get() && meanwhile;
}

// Whether it becomes true within half a minute.
bool Eventually(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

std::future<bool> RunAside(RenderThread* thread, const std::string& lane, const RenderThread::Work& work) {
  return std::async(std::launch::async, [=] { return thread->Run(lane, work); });
}

// Asks for a picture while another is being rendered, then for newer ones of its lane until it is dropped. One request
// would do if one could see from outside that the first waits. Whether it was dropped; the newer ones are in `newer`.
bool DroppedForNewer(RenderThread* thread, const std::string& lane, const RenderThread::Work& work,
                     std::vector<std::future<bool>>* newer) {
  std::future<bool> old = RunAside(thread, lane, work);
  const bool ended = Eventually([&] {
    newer->push_back(RunAside(thread, lane, [](const Stale&) {}));
    return old.wait_for(std::chrono::milliseconds(20)) == std::future_status::ready;
  });
  return ended && !old.get();
}

}  // namespace

TEST_CASE("pictures for people go first, also while a frame of a video is being rendered") {
  RenderThread thread;
  CHECK(RunsMeanwhile(&thread, [](const Stale&) {}));
  CHECK(RunsMeanwhile(&thread, [](const Stale& stale) { CHECK_FALSE(stale()); }));
}

TEST_CASE("what goes wrong in a picture leaves the video that it went before") {
  RenderThread thread;
  CHECK(RunsMeanwhile(&thread, [](const Stale&) { throw std::runtime_error("broken"); }));
  CHECK(RunsMeanwhile(&thread, [](const Stale&) {}));
}

TEST_CASE("a picture that waits is dropped for a newer one of its lane, which is rendered") {
  RenderThread thread;
  std::promise<void> begun, go_on;
  std::future<bool> in_hand = RunAside(&thread, "other", [&](const Stale&) {
    begun.set_value();
    go_on.get_future().wait();
  });
  begun.get_future().wait();
  std::atomic<bool> rendered{false};
  std::vector<std::future<bool>> newer;
  CHECK(DroppedForNewer(
      &thread, "tab", [&](const Stale&) { rendered = true; }, &newer));
  go_on.set_value();
  CHECK(in_hand.get());
  bool any = false;
  for (std::future<bool>& result : newer) any = result.get() || any;
  CHECK(any);
  CHECK_FALSE(rendered);
}

TEST_CASE("a picture in hand becomes stale by a newer one of its lane, not by another lane's") {
  RenderThread thread;
  std::vector<std::future<bool>> others;
  std::future<bool> newer;
  bool by_another = true, by_its_own = false;
  CHECK(thread.Run("tab", [&](const Stale& stale) {
    if (!DroppedForNewer(
            &thread, "other", [](const Stale&) {}, &others))
      return;
    by_another = stale();
    newer = RunAside(&thread, "tab", [](const Stale&) {});
    by_its_own = Eventually(stale);
  }));
  CHECK_FALSE(by_another);
  CHECK(by_its_own);
  CHECK(newer.get());
}

TEST_CASE("what is in hand when the thread is destroyed ends early: a picture, and the work behind it") {
  auto thread = std::make_unique<RenderThread>();
  RenderThread* const used = thread.get();
  std::promise<void> begun;
  bool picture_told = false, behind_told = false;
  std::future<bool> picture;
  std::future<bool> behind = std::async(std::launch::async, [&] {
    return used->RunBehind([&](const Stale& stale) {
      picture = RunAside(used, "tab", [&](const Stale& stale_too) {
        begun.set_value();
        picture_told = Eventually(stale_too);
      });
      behind_told = Eventually(stale);
    });
  });
  begun.get_future().wait();
  thread.reset();
  CHECK(picture.get());
  CHECK(behind.get());
  CHECK(picture_told);
  CHECK(behind_told);
}

TEST_CASE("destroying the thread ends work that runs behind") {
  auto thread = std::make_unique<RenderThread>();
  RenderThread* const used = thread.get();
  std::promise<void> begun;
  bool told = false;
  std::future<bool> behind = std::async(std::launch::async, [&] {
    return used->RunBehind([&](const Stale& stale) {
      begun.set_value();
      told = Eventually(stale);
    });
  });
  begun.get_future().wait();
  thread.reset();
  CHECK(behind.get());
  CHECK(told);
}
