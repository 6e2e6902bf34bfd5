// How fast a trained run shows pictures.
#pragma once

#include <utility>
#include <vector>

#include "libeditnerf/benchmarks/benchmark_result.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

struct RenderBenchmark {
  std::vector<std::pair<int64_t, int64_t>> sizes = {{160, 90}, {320, 180}, {640, 360}};  // width, height
  int64_t frames = 9;  // training views, evenly spaced; medians are over these
};

// Frames a second, milliseconds of the clock and of the processor, and field evaluations per pixel at each size and, as
// "preview", at half the size of the run's own images, as an editor shows while a key point is dragged. The smallest
// size is also rendered module by module, for the ratio.
BenchmarkResult RunRenderBenchmark(const Run& run, const RenderBenchmark& options);

}  // namespace editnerf
