// Scenes, configurations and key points with which a test trains in a second.
#pragma once

#include <torch/types.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {

namespace fs = std::filesystem;

inline Scene SmallScene(const char* name, int64_t frames, int64_t width) {
  SyntheticOptions options;
  options.frames = frames;
  options.val_frames = 2;
  options.edit_frames = 0;
  options.width = width;
  options.height = width * 9 / 16;
  options.samples_per_side = 2;
  return MakeSyntheticScene(name, options);
}

inline const Scene& TinyScene() {
  static const Scene scene = SmallScene("hinge", 8, 32);
  return scene;
}

inline Config Load(const char* name) {
  return LoadConfig(fs::path(EDITNERF_SOURCE_DIR) / "configs" / (std::string(name) + ".yaml"));
}

// The default configuration at a size for tests.
inline Config SmallFast() {
  Config config = Load("fast");
  config.render.march_steps = 32;
  config.render.occupancy_resolution = 16;
  config.field.fast.canonical_hash.num_levels = 6;
  config.field.fast.canonical_hash.log2_table_size = 12;
  config.field.fast.local_hash = config.field.fast.canonical_hash;
  config.field.fast.local_window_steps = 0;
  for (StageConfig* stage : {&config.pretrain, &config.train}) {
    stage->steps = 60;
    stage->seconds = 0;
    stage->rays_per_step = 256;
    stage->samples_per_step = 0;
    stage->evaluate_every = 0;
    stage->log_every = 1;
  }
  return config;
}

// The fields that a step can go through, each its own way: fused in float32 and, where the processor has it, in
// bfloat16, with `modules` module by module as well, and the paper's.
inline std::vector<std::pair<std::string, Config>> FieldWays(bool modules) {
  std::vector<std::pair<std::string, Config>> ways;
  for (const std::string kernel : {"fp32", "bf16", "modules"}) {
    if (kernel == "bf16" && FastestBf16() == Bf16Unit::kNone) continue;
    if (kernel == "modules" && !modules) continue;
    Config config = SmallFast();
    config.field.fast.kernel = kernel;
    ways.emplace_back(kernel, config);
  }
  ways.emplace_back("paper", Load("tiny"));
  return ways;
}

// The lid's corner on its true path, as tracks [T, 1, 3].
inline torch::Tensor TrueTracks(const Scene& scene) {
  std::vector<torch::Tensor> tracks;
  const torch::Tensor start = torch::tensor({0.1, 0.0, 0.1, 1.0}, torch::kFloat64);
  const torch::Tensor motions = scene.truth->scene_from_object.select(1, 0);
  const torch::Tensor inverse = torch::linalg_inv(motions[scene.train[0]]);
  for (const int64_t frame : scene.train) {
    tracks.push_back(torch::mv(motions[frame], torch::mv(inverse, start)).slice(0, 0, 3));
  }
  return torch::stack(tracks).unsqueeze(1).to(torch::kFloat32);
}

// What detection would have found in the tiny scene: no flow but the camera's is known, depth is true.
inline KeyPointSupervision SupervisionOf(const Scene& scene) {
  const auto frames = static_cast<int64_t>(scene.train.size());
  KeyPointSupervision supervision;
  supervision.flow = torch::zeros({frames - 1, scene.height(), scene.width(), 2});
  supervision.depth = scene.truth->depth.slice(0, 0, frames).to(torch::kFloat32).clone();
  return supervision;
}

// What is logged while it lives, in place of the terminal.
class CaughtLog {
 public:
  CaughtLog() : level_(GetLogLevel()) {
    SetLogLevel(LogLevel::kWarning);
    SetLogSink([this](LogLevel, const std::string& message) { text_ += message + "\n"; });
  }
  ~CaughtLog() {
    SetLogSink({});
    SetLogLevel(level_);
  }
  CaughtLog(const CaughtLog&) = delete;
  CaughtLog& operator=(const CaughtLog&) = delete;
  const std::string& text() const { return text_; }

 private:
  LogLevel level_;
  std::string text_;
};

// An empty folder that is gone when this goes.
class TrainingFolder {
 public:
  explicit TrainingFolder(const std::string& name)
      : path_(fs::temp_directory_path() / ("editnerf_" + name + "_" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
  }
  ~TrainingFolder() { fs::remove_all(path_); }
  TrainingFolder(const TrainingFolder&) = delete;
  TrainingFolder& operator=(const TrainingFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

inline fs::path Scratch(const std::string& name) {
  const fs::path folder = fs::temp_directory_path() / ("editnerf_trainer_" + name + "_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  return folder;
}

}  // namespace editnerf
