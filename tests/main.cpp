// The tests' entry point: two threads, whatever LibTorch starts with, so that results do not depend on the machine, and
// the same random numbers in every run; `--rng-seed N` draws others.
#include <torch/types.h>
#include <torch/utils.h>

#include <cstdlib>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"

#define CATCH_CONFIG_RUNNER
#include "tests/catch.h"

// Read by the sanitizers before main. Catch2 asks for memory that may not throw and gives it back to the usual delete,
// which Clang's runtime takes for a mistake.
extern "C" const char* __asan_default_options() { return "alloc_dealloc_mismatch=0"; }
extern "C" const char* __ubsan_default_options() { return "print_stacktrace=1"; }

namespace {

// LibTorch's own generator starts from the clock.
#if __has_include(<catch2/catch_all.hpp>)
struct SeedTorch : Catch::EventListenerBase {
  using EventListenerBase::EventListenerBase;
  void testCaseStarting(const Catch::TestCaseInfo&) override { torch::manual_seed(Catch::getSeed()); }
};
#else
struct SeedTorch : Catch::TestEventListenerBase {
  using TestEventListenerBase::TestEventListenerBase;
  void testCaseStarting(const Catch::TestCaseInfo&) override { torch::manual_seed(Catch::rngSeed()); }
};
#endif
CATCH_REGISTER_LISTENER(SeedTorch)

}  // namespace

int main(int argc, char** argv) {
  // For the programs that tests start, and so that RunProgram, called by a test, does not start this one again.
  setenv("GOMP_SPINCOUNT", "1000", 0);
  setenv("OPENBLAS_THREAD_TIMEOUT", "12", 0);
  editnerf::SetNumThreads(2);
  editnerf::SetLogLevel(editnerf::LogLevel::kError);
  return Catch::Session().run(argc, argv);
}
