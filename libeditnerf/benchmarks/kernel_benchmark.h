// Every kernel beside what it stands for in LibTorch's operations.
#pragma once

#include "libeditnerf/benchmarks/benchmark_result.h"
#include "libeditnerf/config/config.h"

namespace editnerf {

struct KernelBenchmark {
  int64_t samples = 16384;
  int64_t repeats = 7;
  double least_seconds = 0.02;  // of a repeat
  int64_t threads = 0;          // beside one; 0: every core
};

// ns per sample by the clock and of the processor; by processor time, the ratio to the reference, GFLOP/s of a core and
// the share of its measured peak; for one thread and for all of them.
// References of single kernels are plain LibTorch operations; that of the field is the field module by module, which
// shares the kernels of hash encoding and small networks. Operations are counted by hand, multiply-adds as two, and
// only those of encodings and networks. Leaves NumThreads() as it was.
BenchmarkResult RunKernelBenchmark(const Config& config, const KernelBenchmark& options);

}  // namespace editnerf
