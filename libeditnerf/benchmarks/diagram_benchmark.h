// Error against run time of several configurations, in one diagram.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/benchmarks/bench_scene.h"
#include "libeditnerf/benchmarks/benchmark_result.h"

namespace editnerf {

struct DiagramVariant {
  std::string name, description;
  Config config;
};

// "fast" as given; "warp", "appearance", "no-direction" and "no-local": that with a component more or less; "fp32": in
// float32; "modules": that without the fused pass; and "paper", the paper's networks with batches that a processor can
// take.
std::vector<DiagramVariant> DiagramVariants(const Config& fast, const Config& paper);

struct DiagramBenchmark {
  double seconds = 60;           // of training, for each variant
  int64_t measurements = 12;     // of the held-out error, in each
  std::filesystem::path folder;  // runs, and diagram.svg
  uint64_t seed = 1;
  torch::Device device = torch::kCPU;
};

// Trains every variant on the scene from the same key points and draws held-out PSNR against seconds of training.
// Tables: seconds to 25, 30, 35 and 40 dB, and PSNR at the end, held out and, where the scene has any, of edits.
BenchmarkResult RunDiagramBenchmark(const BenchScene& bench, const std::vector<DiagramVariant>& variants,
                                    const DiagramBenchmark& options);

}  // namespace editnerf
