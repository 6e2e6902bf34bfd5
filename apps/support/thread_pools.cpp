#include "support/thread_pools.h"

#include <unistd.h>

#include <cstdlib>

namespace editnerf {
namespace {

constexpr const char* kMark = "EDITNERF_SPINS_SET";

}  // namespace

void RestartWithShortSpins(char* const* argv) {
  if (std::getenv(kMark) != nullptr || std::getenv("OMP_WAIT_POLICY") != nullptr) return;
  setenv(kMark, "1", 1);
  setenv("GOMP_SPINCOUNT", "1000", 0);
  setenv("OPENBLAS_THREAD_TIMEOUT", "12", 0);  // 2^12 cycles
  execv("/proc/self/exe", argv);
  // Where the system does not allow that, the program runs on, only slower.
}

}  // namespace editnerf
