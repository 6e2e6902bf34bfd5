// How far every numerical operator is from the truth where careless formulations fail (docs/numerics.md).
#pragma once

#include "libeditnerf/benchmarks/benchmark_result.h"

namespace editnerf {

struct StabilityBenchmark {
  int64_t repeats = 5;           // of a time
  double least_seconds = 0.005;  // of a repeat
};

// Every operator in every situation, in each of its variants: LibTorch's operations in float64 and float32, and the
// kernels with every instruction set that this machine has; against references in extended precision that are
// formulated otherwise. Then ways to integrate transmittance, error against run time.
//   json: {"rows": [{"operation", "situation", "variant", "error", "bound", "gradient_error", "gradient_bound",
//          "finite", "passes"}], "failed": number of rows that do not pass, "integration": [{"way", "thickness",
//          "steps", "error", "nanoseconds"}]}; an error that is not finite is null, and so is a gradient's where a
//          variant has none.
BenchmarkResult RunStabilityBenchmark(const StabilityBenchmark& options);

}  // namespace editnerf
