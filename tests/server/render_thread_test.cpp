#include "libeditnerf/server/render_thread.h"

#include <chrono>
#include <functional>
#include <future>
#include <stdexcept>

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
