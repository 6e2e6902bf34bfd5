#include "libeditnerf/base/interrupt.h"

#include <csignal>

namespace editnerf {
namespace {

volatile std::sig_atomic_t g_interrupted = 0;

void OnSignal(int signal_number) {
  if (g_interrupted != 0) {
    std::signal(signal_number, SIG_DFL);
    std::raise(signal_number);
    return;
  }
  g_interrupted = 1;
}

}  // namespace

void InstallInterruptHandler() {
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
}

bool InterruptRequested() { return g_interrupted != 0; }
void RequestInterrupt() { g_interrupted = 1; }
void ClearInterrupt() { g_interrupted = 0; }

}  // namespace editnerf
