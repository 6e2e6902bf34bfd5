#include "libeditnerf/base/phase_clock.h"

#include <chrono>
#include <thread>

#include "libeditnerf/base/parallel.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr double kNap = 0.002;  // seconds; a sleep may take longer, never shorter

void Nap() { std::this_thread::sleep_for(std::chrono::duration<double>(kNap)); }

double SecondsOf(const PhaseSeconds& seconds, Phase phase) { return seconds[static_cast<size_t>(phase)]; }

}  // namespace

TEST_CASE("a phase clock sums the scopes of all threads, and those alone that begin while it runs") {
  { const ThreadPhase before(Phase::kEncoding); }
  StartPhaseClock();
  ParallelFor(4, 1, [](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const ThreadPhase phase(Phase::kProducts);
      Nap();
    }
  });
  const PhaseSeconds seconds = StopPhaseClock();
  {
    const ThreadPhase after(Phase::kProducts);
    Nap();
  }
  CHECK(SecondsOf(seconds, Phase::kProducts) >= 4 * kNap);
  CHECK(SecondsOf(seconds, Phase::kEncoding) == 0);
  StartPhaseClock();
  CHECK(SecondsOf(StopPhaseClock(), Phase::kProducts) == 0);
}

TEST_CASE("a phase of the whole team counts for every thread and hides the scopes inside") {
  StartPhaseClock();
  {
    const TeamPhase phase(Phase::kOccupancy);
    const ThreadPhase inside(Phase::kEncoding);
    Nap();
  }
  {
    const ThreadPhase later(Phase::kMarching);
    Nap();
  }
  const PhaseSeconds seconds = StopPhaseClock();
  CHECK(SecondsOf(seconds, Phase::kOccupancy) >= static_cast<double>(NumThreads()) * kNap);
  CHECK(SecondsOf(seconds, Phase::kEncoding) == 0);
  CHECK(SecondsOf(seconds, Phase::kMarching) >= kNap);
}
