// The stages of the whole way as functions: what the programs call, and what an embedding program can call too. Before
// it computes anything, a stage logs what memory it will take (stage_memory.h).
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <optional>

#include "libeditnerf/config/config.h"
#include "libeditnerf/pipeline/surface_maps.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/depth_targets.h"
#include "libeditnerf/training/key_point_supervision.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

struct StageRequest {
  std::filesystem::path scene_folder;
  std::filesystem::path out;  // run folder
  Config config;
  torch::Device device = torch::kCPU;
  bool resume = false;               // continue from a checkpoint in `out`, where there is one
  std::filesystem::path pretrained;  // run folder that train.warm_start takes from; empty: none
};

// A scene folder, or a packed scene (*.safetensors). Throws DataError.
Scene OpenScene(const std::filesystem::path& path, const DataConfig& config);

// Throws DataError unless `scene`, at whatever image size, is the one that the run was trained on: the same scene units
// and training frames.
void CheckSameScene(const Run& run, const Scene& scene);

// Trains the HyperNeRF and writes RUN with surface_maps.safetensors. Throws Interrupted after Ctrl-C.
void RunPretraining(const Scene& scene, const StageRequest& request);

// Throws ConfigError for settings that training cannot follow together.
void CheckTraining(const Config& config);

// Trains the editable field from the key points, flow and depth that detection left in the scene folder (or in
// `detection_folder`), and writes RUN. A scene without key points is trained as a static one, with a warning.
// Components of the field that are left to `auto` are decided first (component_trials.h), within the stage's seconds,
// and RUN/components.json says how.
void RunTraining(const Scene& scene, const StageRequest& request, const std::filesystem::path& detection_folder);

// What detection wrote: tracks [T, N, 3] in scene units (N = 0 where there are none), rotation vectors [T, N, 3] of the
// parts that turn (undefined where none does) and the key points' supervision.
struct DetectedKeyPoints {
  torch::Tensor tracks, turns;
  std::optional<KeyPointSupervision> supervision;
  std::optional<Vec3> lamp;              // the direction of the light, unit length
  DepthTargets still_depth, part_depth;  // known distances of what stands still, and of rigid parts that move
};
DetectedKeyPoints ReadDetectedKeyPoints(const Scene& scene, const std::filesystem::path& folder);

// RunTraining with these instead of what lies in a folder, and without trials: what is left to `auto` stays as it is
// while undecided.
void RunTraining(const Scene& scene, const StageRequest& request, DetectedKeyPoints detected);

}  // namespace editnerf
