// The most memory that this process has held resident since a moment, as Linux counts it (VmHWM, proc(5)).
#pragma once

#include <malloc.h>
#include <torch/types.h>

#include <cstdint>
#include <fstream>
#include <string>

namespace editnerf {

class PeakMemory {
 public:
  // Memory that was freed before does not hide what is taken from now on, and whatever is large and freed later goes
  // back to the system at once.
  PeakMemory() {
    ::mallopt(M_MMAP_THRESHOLD, 128 << 10);
    ::malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";
    before_ = Bytes("VmRSS:");
  }

  int64_t Growth() const { return Bytes("VmHWM:") - before_; }

  // False where the peak cannot be begun anew, and under sanitizers, which take as much memory again.
  static bool Measurable() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return false;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(memory_sanitizer) || __has_feature(thread_sanitizer)
    return false;
#endif
#endif
    torch::ones({int64_t{16} << 20}, torch::kFloat32);  // for a moment
    const PeakMemory peak;
    return Bytes("VmRSS:") > 0 && peak.Growth() < int64_t{8} << 20;
  }

 private:
  static int64_t Bytes(const std::string& key) {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;) {
      if (word != key) continue;
      int64_t kibibytes = 0;
      status >> kibibytes;
      return kibibytes * 1024;
    }
    return 0;
  }

  int64_t before_ = 0;
};

}  // namespace editnerf
