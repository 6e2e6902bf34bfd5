#include "libeditnerf/base/machine.h"

#include <sys/resource.h>
#include <time.h>

#include <fstream>

#include "editnerf_commit.h"  // made by cmake/WriteCommit.cmake

namespace editnerf {

namespace {

double SecondsOf(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

std::string ProcessorName() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0 && line.find(':') + 2 < line.size()) return line.substr(line.find(':') + 2);
  }
  return "";
}

std::string LibraryVersion() { return EDITNERF_VERSION; }

std::string LibraryCommit() { return EDITNERF_COMMIT; }

double ProcessorSeconds() { return SecondsOf(CLOCK_PROCESS_CPUTIME_ID); }
double ThreadSeconds() { return SecondsOf(CLOCK_THREAD_CPUTIME_ID); }

long PeakResidentBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss * 1024;  // kilobytes on Linux
}

}  // namespace editnerf
