// A run: one stage's field with all that rendering it takes, and its folder on disk.
//
//   RUN/checkpoint.safetensors   weights, occupancy, optimiser state, counters; configuration and cameras in the
//   metadata RUN/config.yaml              the effective configuration RUN/metrics.csv              error against run
//   time
//
// A checkpoint needs no scene folder: cameras, splits and units travel with it, images do not.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/render/ray_renderer.h"
#include "libeditnerf/scene/scene.h"

namespace editnerf {

// What has been spent so far.
struct RunCounters {
  int64_t step = 0;
  int64_t rays = 0;
  int64_t samples = 0;
  double seconds_training = 0;                // optimisation alone
  double seconds_total = 0;                   // with measurements and checkpoints
  int64_t skipped = 0;                        // steps, because something was not finite
  int64_t rolled_back = 0;                    // times that training went back to a good state
  std::map<std::string, int64_t> not_finite;  // of the skipped steps, by loss term or "gradient of PARAMETER"

  void AddSkipped(const std::vector<std::string>& what);
};

// "12 of 400 steps were skipped, not being finite (reconstruction 12, motion 1); training went back once".
std::string SkippedText(const RunCounters& counters);

struct Run {
  Config config;
  FieldStage stage = FieldStage::kTrain;
  Scene scene;             // after LoadRun: without images and ground truth
  std::string scene_path;  // where the scene was read from, for measurements; may have moved since
  std::shared_ptr<HyperspaceField> field;
  std::shared_ptr<RayRenderer> renderer;
  RunCounters counters;
  torch::Device device = torch::kCPU;
};

// The settings of the run's own stage.
inline const StageConfig& StageOf(const Run& run) {
  return run.stage == FieldStage::kPretrain ? run.config.pretrain : run.config.train;
}

// An untrained run over `scene`. For FieldStage::kTrain: `initial_tracks` [T, N, 3], scene units, and `initial_turns`
// [T, N, 3], rotation vectors of the parts (undefined where none turns), which field.fast.local_frames makes use of;
// `lamp`: towards the light, unit length, for field.fast.shade.
Run MakeRun(const Config& config, FieldStage stage, const Scene& scene, const torch::Tensor& initial_tracks,
            torch::Device device, const torch::Tensor& initial_turns = torch::Tensor(),
            const std::optional<Vec3>& lamp = std::nullopt);

// Writes RUN/checkpoint.safetensors atomically; `extra` tensors (optimiser, generator) travel under their names.
void SaveRun(const Run& run, const std::filesystem::path& folder,
             const std::map<std::string, torch::Tensor>& extra = {});

struct LoadedRun {
  Run run;
  std::map<std::string, torch::Tensor> extra;
};

enum class Weights { kFinite, kAsTheyAre };

// Throws CheckpointError naming the file and what is missing, damaged, of another version, or not finite.
LoadedRun LoadRunWithExtra(const std::filesystem::path& folder, torch::Device device,
                           Weights weights = Weights::kFinite);

// The same, to be shown and measured, not trained on. A run that was trained with field.fast.kernel: bf16 is opened on
// processors without bfloat16 as well, with another kernel and a logged line; training it there is an error.
Run LoadRun(const std::filesystem::path& folder, torch::Device device = torch::kCPU);

// What was spent on a run, without its tensors; throws CheckpointError.
RunCounters LoadCounters(const std::filesystem::path& folder);

}  // namespace editnerf
