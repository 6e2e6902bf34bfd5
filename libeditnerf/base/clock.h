// A stopwatch on the steady clock that can be paused, in seconds.
#pragma once

#include <chrono>

namespace editnerf {

class Stopwatch {
 public:
  Stopwatch() = default;
  double Seconds() const { return running_ ? elapsed_ + Since(start_) : elapsed_; }
  void Pause() {
    if (running_) elapsed_ += Since(start_);
    running_ = false;
  }
  void Resume() {
    if (!running_) start_ = Clock::now();
    running_ = true;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double Since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

  double elapsed_ = 0;
  bool running_ = true;
  Clock::time_point start_ = Clock::now();
};

}  // namespace editnerf
