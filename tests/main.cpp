// The tests' entry point: two threads, whatever LibTorch starts with, so that results do not depend on the machine.
#define CATCH_CONFIG_RUNNER
#include "tests/catch.h"

#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"

int main(int argc, char** argv) {
  editnerf::SetNumThreads(2);
  editnerf::SetLogLevel(editnerf::LogLevel::kError);
  return Catch::Session().run(argc, argv);
}
