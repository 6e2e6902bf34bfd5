// The paper's tables on scenes of one's own: fields beside each other, the ablation, depth, key points and flow.
//
// Every scene and seed goes the whole way once: pretraining, detection as it is and as the paper has it, and then a
// training for every row of the tables. A row that is finished leaves FOLDER/SCENE/seed_S/ROW/scores.json, and is not
// run again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/benchmarks/benchmark_result.h"
#include "libeditnerf/config/config.h"
#include "libeditnerf/evaluation/lpips.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"

namespace editnerf {

struct TablesBenchmark {
  std::vector<std::string> scenes;  // names of synthetic scenes, scene folders, packed scenes
  SyntheticOptions synthetic;
  std::vector<int64_t> seeds = {1};
  Config paper;              // of the paper's field
  double paper_seconds = 0;  // of its training; 0: left out, as a step of it takes seconds on a processor
  bool ladder = true;        // whether the ablation is run
  int64_t max_frames = 0;    // of each protocol; 0: all
  Lpips lpips = nullptr;     // empty: not measured
  torch::Device device = torch::kCPU;
  std::filesystem::path folder;
};

// `config` is that of pretraining, detection and the fast field. Tables: fields, ablation (edits, where the scene has
// ground truth), depth of parts, key points, optical flow. Throws Interrupted after Ctrl-C, and what the stages throw;
// repeat the call to go on.
BenchmarkResult RunTablesBenchmark(const Config& config, const TablesBenchmark& options);

}  // namespace editnerf
