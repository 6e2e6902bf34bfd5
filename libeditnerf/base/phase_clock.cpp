#include "libeditnerf/base/phase_clock.h"

#include "libeditnerf/base/parallel.h"

namespace editnerf {
namespace {

std::array<std::atomic<int64_t>, kNumPhases> g_nanoseconds;

}  // namespace

namespace phase_clock {

void Add(Phase phase, int64_t nanoseconds) {
  g_nanoseconds[static_cast<size_t>(phase)].fetch_add(nanoseconds, std::memory_order_relaxed);
}

}  // namespace phase_clock

const char* PhaseName(Phase phase) {
  static constexpr const char* kNames[kNumPhases] = {"encoding", "products",  "table_gradients", "compositing",
                                                     "marching", "occupancy", "guard",           "adam"};
  return kNames[static_cast<size_t>(phase)];
}

void StartPhaseClock() {
  for (auto& sum : g_nanoseconds) sum = 0;
  phase_clock::g_running = true;
}

PhaseSeconds StopPhaseClock() {
  phase_clock::g_running = false;
  PhaseSeconds seconds;
  for (size_t i = 0; i < kNumPhases; ++i) seconds[i] = 1e-9 * static_cast<double>(g_nanoseconds[i].load());
  return seconds;
}

TeamPhase::TeamPhase(Phase phase)
    : phase_(phase), counts_(phase_clock::g_running.exchange(false)), start_(std::chrono::steady_clock::now()) {}

TeamPhase::~TeamPhase() {
  if (!counts_) return;
  const std::chrono::nanoseconds passed = std::chrono::steady_clock::now() - start_;
  phase_clock::Add(phase_, passed.count() * NumThreads());
  phase_clock::g_running = true;
}

}  // namespace editnerf
