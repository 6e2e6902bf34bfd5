// The scene of a benchmark, and runs on it.
#pragma once

#include <torch/types.h>

#include <string>

#include "libeditnerf/config/config.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

// Of a step of the paper's field: its 6,144 rays of 384 evaluations would take 50 GB for one step's graph.
constexpr int64_t kPaperRays = 256;

struct BenchScene {
  std::string source;  // as given
  Scene scene;
  torch::Tensor tracks;  // [T, N, 3], scene units; N = 0 where nothing moves or nothing is known of it
};

// A synthetic scene by name, made on the fly with `options`, or a scene folder or packed scene. Key points are those
// that enf-detect-keypoints left in a scene folder, or else points on the true paths of the parts.
BenchScene OpenBenchScene(const std::string& source, const SyntheticOptions& options, const DataConfig& config);

// An untrained run of the stage.
Run MakeBenchRun(const Config& config, FieldStage stage, const BenchScene& bench, torch::Device device);

// Another one with the weights, grids and counters of `run`, but a configuration of its own; it shares no memory.
Run CopyRun(const Run& run, const Config& config, const BenchScene& bench);

// Trains for this many steps and at most this many seconds (0: no limit), without measuring or saving anything.
Run TrainBriefly(const Run& run, const Scene& scene, int64_t steps, double seconds);

}  // namespace editnerf
