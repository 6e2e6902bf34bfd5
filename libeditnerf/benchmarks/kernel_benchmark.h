// Every kernel beside what it stands for in LibTorch's operations, and the field beside itself with other parts.
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
// the share of its measured peak, float32's or that of the unit for bfloat16; for one thread and for all of them.
// References are plain LibTorch operations alone; those of bfloat16's networks and tables are the kernels in float32.
// Operations are counted by hand, multiply-adds as two, and only those of encodings and networks.
// Beside it, what a step of training along rays takes of the processor where the field has fewer and more parts, and
// where that time goes.
// Leaves NumThreads() as it was.
BenchmarkResult RunKernelBenchmark(const Config& config, const KernelBenchmark& options);

}  // namespace editnerf
