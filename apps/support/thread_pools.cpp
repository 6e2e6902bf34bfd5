#include "support/thread_pools.h"

#include <unistd.h>

#include <cstdlib>

namespace editnerf {

void RestartWithShortSpins(char* const* argv) {
  const auto chosen = [](const char* name) { return std::getenv(name) != nullptr; };
  if (chosen("OMP_WAIT_POLICY") || (chosen("GOMP_SPINCOUNT") && chosen("OPENBLAS_THREAD_TIMEOUT"))) return;
  setenv("GOMP_SPINCOUNT", "1000", 0);
  setenv("OPENBLAS_THREAD_TIMEOUT", "12", 0);  // 2^12 cycles
  execv("/proc/self/exe", argv);
  // Where the system does not allow that, the program runs on, only slower.
}

}  // namespace editnerf
