// Where the time of the fused passes goes, for benchmarks. While no clock runs, a scope costs the reading of a flag.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace editnerf {

enum class Phase {
  kEncoding,        // hash encodings, forward
  kProducts,        // the small networks, both ways
  kTableGradients,  // hash encodings, backward: to the tables and to the positions
  kCompositing,     // compositing, the loss and its gradients
  kMarching,        // walking rays, and sorting out the samples that light reaches
  kOccupancy,       // updates of the occupancy grids, evaluations of the field included
  kGuard,           // whether all losses and gradients are finite
  kAdam,
};
constexpr size_t kNumPhases = 8;
const char* PhaseName(Phase phase);  // "encoding", ...

// Seconds of each phase, summed over the threads.
using PhaseSeconds = std::array<double, kNumPhases>;

namespace phase_clock {
inline std::atomic<bool> g_running{false};
void Add(Phase phase, int64_t nanoseconds);
}  // namespace phase_clock

// From Start to Stop scopes are counted, of whatever thread. One clock at a time.
void StartPhaseClock();
PhaseSeconds StopPhaseClock();

// One thread's time from here to the end of the scope. Scopes do not nest.
class ThreadPhase {
 public:
  explicit ThreadPhase(Phase phase) : phase_(phase), counts_(phase_clock::g_running.load(std::memory_order_relaxed)) {
    if (counts_) start_ = Clock::now();
  }
  ~ThreadPhase() {
    if (counts_) phase_clock::Add(phase_, std::chrono::nanoseconds(Clock::now() - start_).count());
  }
  ThreadPhase(const ThreadPhase&) = delete;
  ThreadPhase& operator=(const ThreadPhase&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  Phase phase_;
  bool counts_;
  Clock::time_point start_;
};

// The time of all threads, as the calling one waits for the others; scopes inside are not counted.
class TeamPhase {
 public:
  explicit TeamPhase(Phase phase);
  ~TeamPhase();
  TeamPhase(const TeamPhase&) = delete;
  TeamPhase& operator=(const TeamPhase&) = delete;

 private:
  Phase phase_;
  bool counts_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace editnerf
