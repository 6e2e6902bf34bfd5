// What a training step costs, and where its time goes.
#pragma once

#include "libeditnerf/benchmarks/bench_scene.h"
#include "libeditnerf/benchmarks/benchmark_result.h"

namespace editnerf {

struct TrainBenchmark {
  FieldStage stage = FieldStage::kTrain;
  int64_t warm_up = 400;  // steps before anything is measured, so that surfaces have formed
  int64_t steps = 48;     // of a measurement in the fused pass; module by module a sixth as many, plain one
  int64_t repeats = 3;
  torch::Device device = torch::kCPU;
};

// From one trained state, by turns in the fused pass, module by module with the modules' kernels, and in plain LibTorch
// operations alone (autograd, gathers and matrix products): samples and rays a second by the clock, and processor time
// of a sample; and the shares of the fused pass's phases, of the time of all threads together.
BenchmarkResult RunTrainBenchmark(const BenchScene& bench, const Config& config, const TrainBenchmark& options);

struct GrowthBenchmark {
  std::string scene = "cups";
  std::vector<int64_t> samples = {8192, 16384, 32768, 65536};  // of a step
  std::vector<int64_t> frames = {50, 200, 800};
  int64_t width = 96, height = 54;
  int64_t warm_up = 300, steps = 32;  // of each measurement
};

// Time of a step against its samples, which should be a line, and against the number of training frames, on which it
// should not depend; on synthetic scenes made on the fly.
BenchmarkResult RunGrowthBenchmark(const Config& config, const GrowthBenchmark& options);

}  // namespace editnerf
