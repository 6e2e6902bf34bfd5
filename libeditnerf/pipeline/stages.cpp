#include "libeditnerf/pipeline/stages.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/pipeline/component_trials.h"
#include "libeditnerf/pipeline/key_point_merging.h"
#include "libeditnerf/pipeline/stage_memory.h"
#include "libeditnerf/scene/packed_scene.h"
#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/detection_run.h"
#include "libeditnerf/tracking/flow_cache.h"
#include "libeditnerf/tracking/flow_choice.h"
#include "libeditnerf/tracking/still_depth.h"
#include "libeditnerf/training/trainer.h"
#include "libeditnerf/training/warm_start.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

constexpr double kLeastShareLeft = 0.5;  // of a stage's seconds, however long its trials took

bool Resumes(const StageRequest& request) {
  return request.resume && fs::exists(request.out / "checkpoint.safetensors");
}

std::vector<std::string> TrainingIds(const Scene& scene) {
  std::vector<std::string> ids;
  for (const int64_t frame : scene.train) ids.push_back(scene.frames[static_cast<size_t>(frame)].id);
  return ids;
}

void WriteDepthErrors(const std::vector<DepthError>& errors, const fs::path& path) {
  nlohmann::ordered_json json;
  for (const DepthError& error : errors) {
    LogInfo("depth of {}: median error {:.2g} %, 90th percentile {:.2g} %", error.part, 100 * error.median,
            100 * error.percentile90);
    json[error.part] = {{"median", error.median}, {"percentile90", error.percentile90}, {"pixels", error.pixels}};
  }
  WriteJson(path, json);
}

fs::path DecisionsPath(const fs::path& run_folder) { return run_folder / "components.json"; }

// The stage as trials decided, in the time that they left, and a file that says how.
void Follow(const ComponentTrials& trials, FieldStage stage, StageRequest* request) {
  request->config = trials.config;
  double& seconds = (stage == FieldStage::kPretrain ? request->config.pretrain : request->config.train).seconds;
  if (seconds > 0) seconds = std::max(seconds - trials.seconds, kLeastShareLeft * seconds);
  fs::remove(DecisionsPath(request->out));  // of a run that was here before
  if (trials.trials.empty()) return;
  MakeFolder(request->out);
  WriteJson(DecisionsPath(request->out), ToJson(trials));
}

// A resumed run must be of this scene; its limits of steps and seconds are those asked for now.
LoadedRun Reopen(const Scene& scene, const StageRequest& request, FieldStage stage) {
  LoadedRun loaded = LoadRunWithExtra(request.out, request.device);
  Run& run = loaded.run;
  if (run.stage != stage) {
    Throw<CheckpointError>("{}: a run of the other stage lies here; give another --out", request.out.string());
  }
  if (TrainingIds(run.scene) != TrainingIds(scene)) {
    Throw<CheckpointError>("{}: this run was trained on other frames than {} has; give another --out",
                           request.out.string(), scene.name);
  }
  run.config.pretrain = request.config.pretrain;
  run.config.train = request.config.train;
  return loaded;
}

// The configuration of what will be trained, as far as no trial decides it.
Config ConfigOf(const Scene& scene, const StageRequest& request, FieldStage stage) {
  return Resumes(request) ? Reopen(scene, request, stage).run.config : request.config;
}

void Say(const StageMemory& memory) {
  for (const std::string& line : ToText(memory)) LogInfo("{}", line);
}

void StartWarm(const StageRequest& request, Run* run) {
  if (request.pretrained.empty()) return LogInfo("no pretrained run is given: training starts without one");
  const Run pretrained = LoadRun(request.pretrained, request.device);
  if (TrainingIds(pretrained.scene) != TrainingIds(run->scene)) {
    Throw<CheckpointError>("{}: pretrained on other frames than {} has", request.pretrained.string(), run->scene.name);
  }
  const int64_t taken = TakeOverStaticScene(pretrained, run);
  if (taken == 0)
    return LogWarning("{}: a field of another kind or size: nothing of it is taken over", request.pretrained.string());
  LogInfo("starting from the static scene of {} ({} values)", request.pretrained.string(), taken);
}

Run TrainStage(const Scene& scene, const StageRequest& request, FieldStage stage, DetectedKeyPoints detected,
               const DepthTargets& depth) {
  LoadedRun loaded;
  const bool resumed = Resumes(request);
  if (resumed) {
    loaded = Reopen(scene, request, stage);
    const int64_t own = loaded.run.field->num_key_points();
    if (stage == FieldStage::kTrain && own != detected.tracks.size(1)) {
      Throw<CheckpointError>("{}: the run has {} key points, and detection has found {}; give another --out",
                             request.out.string(), own, detected.tracks.size(1));
    }
    LogInfo("continuing {} at step {}", request.out.string(), loaded.run.counters.step);
  } else {
    loaded.run = MakeRun(request.config, stage, scene, detected.tracks, request.device, detected.turns, detected.lamp);
    if (stage == FieldStage::kTrain && request.config.train.warm_start) StartWarm(request, &loaded.run);
  }
  loaded.run.scene_path = fs::absolute(request.scene_folder).lexically_normal().string();
  Trainer trainer(loaded.run, scene, std::move(detected.supervision), request.out);
  trainer.SetDepthTargets(depth);
  trainer.SetKnownPlaces(Joined(detected.still_depth, detected.part_depth));
  if (resumed) {
    try {
      trainer.Resume(std::exchange(loaded.extra, {}));
    } catch (const CheckpointError& error) {
      Throw<CheckpointError>("{}: {}", (request.out / "checkpoint.safetensors").string(), error.what());
    }
  }
  trainer.Train();
  return trainer.run();
}

// A flow that detection can use too is kept in the run folder.
FlowSequence FlowOf(const Scene& scene, const OpticalFlow& flow, const fs::path& run_folder) {
  const torch::Tensor images = scene.images.index_select(0, torch::tensor(scene.train, torch::kInt64));
  return flow.GainsFromGuess() ? ComputeFlowSequence(images, flow)
                               : CachedFlowSequence(images, flow, FlowCachePath(run_folder));
}

// What optical flow between the training images says of the static scene's depth.
DepthTargets StillDepthOf(const Scene& scene, const OpticalFlow& flow, const fs::path& run_folder) {
  const torch::Tensor no_depth = torch::full({1}, std::numeric_limits<float>::quiet_NaN())
                                     .expand({static_cast<int64_t>(scene.train.size()), scene.height(), scene.width()});
  const Clip clip = MakeClip(scene, no_depth, FlowOf(scene, flow, run_folder));
  DepthTargets targets = TriangulateStillDepth(clip, scene.transform.near, scene.transform.far);
  LogInfo("static depth by {}: {} places known, {:.0f} in each frame", flow.Name(), targets.size(),
          static_cast<double>(targets.size()) / static_cast<double>(scene.train.size()));
  LogDepthTargetErrors(scene, targets);
  return targets;
}

}  // namespace

Scene OpenScene(const fs::path& path, const DataConfig& config) {
  if (path.extension() == ".safetensors") return LoadPackedScene(path);
  return ReadSceneFolder(path, config);
}

void CheckSameScene(const Run& run, const Scene& scene) {
  const SceneTransform &a = run.scene.transform, &b = scene.transform;
  const bool same_units =
      std::abs(a.scale - b.scale) <= 1e-6 * std::abs(a.scale) && Norm(a.center - b.center) * std::abs(a.scale) <= 1e-6;
  if (!same_units || TrainingIds(run.scene) != TrainingIds(scene)) {
    Throw<DataError>("{}: not the scene of this run: its {} differ; give the scene that the run was trained on",
                     scene.name, same_units ? "training frames" : "scale or center");
  }
}

void RunPretraining(const Scene& scene, const StageRequest& request) {
  Say(PlanPretraining(ConfigOf(scene, request, FieldStage::kPretrain), scene, request.device));
  DepthTargets depth;
  if (request.config.pretrain.lambda_depth > 0) {
    depth = StillDepthOf(scene, *MakeOpticalFlow(request.config.flow), request.out);
  }
  StageRequest decided = request;
  if (!Resumes(request)) {
    Follow(DecideAmbient(scene, request, depth), FieldStage::kPretrain, &decided);
  }
  Run run = TrainStage(scene, decided, FieldStage::kPretrain, {}, depth);
  WritePretrainedMaps(RenderSurfaceMaps(run, scene), scene, request.out);
  if (scene.truth) WriteDepthErrors(MeasureDepth(run, scene), request.out / "depth_error.json");
}

void CheckTraining(const Config& config) {
  if (config.train.still_share + config.train.carried_share > 0 && config.render.sampler != "occupancy") {
    Throw<ConfigError>(
        "train.still_share, train.carried_share: rays that begin on their way need render.sampler: occupancy; set both "
        "to 0 for '{}'",
        config.render.sampler);
  }
}

namespace {

// Without what is large.
DetectedKeyPoints ReadTracks(const Scene& scene, const fs::path& folder) {
  const auto frames = static_cast<int64_t>(scene.train.size());
  DetectedKeyPoints detected;
  if (!HasKeyPointFiles(folder)) {
    detected.tracks = torch::zeros({frames, 0, 3});
    return detected;
  }
  detected.tracks = ReadKeyPointFiles(folder).InSceneUnits().to(torch::kFloat32);
  if (detected.tracks.size(0) != frames) {
    Throw<DataError>("{}: data/k_points_auto.txt has {} rows, expected one for each of the {} training frames",
                     folder.string(), detected.tracks.size(0), frames);
  }
  detected.turns = ReadPartTurns(folder, frames, detected.tracks.size(1));
  detected.lamp = ReadLamp(folder);
  return detected;
}

// And what is.
void ReadSupervision(const Scene& scene, const fs::path& folder, DetectedKeyPoints* detected) {
  if (!HasKeyPointFiles(folder)) return;
  const std::vector<std::string> ids = TrainingIds(scene);
  KeyPointSupervision supervision;
  supervision.depth = ReadMedianDepths(folder, ids);
  supervision.flow = ReadFlows(folder, ids);
  for (const torch::Tensor& map : {supervision.depth, supervision.flow}) {
    if (map.size(1) != scene.height() || map.size(2) != scene.width()) {
      Throw<DataError>("{}: depth and flow have {} x {} pixels, the images {} x {}; detect again at this image size",
                       folder.string(), map.size(2), map.size(1), scene.width(), scene.height());
    }
  }
  detected->supervision = supervision;
  const auto known = [&](const fs::path& path) {
    if (!fs::exists(path)) return DepthTargets();
    const torch::Tensor& tracks = detected->tracks;
    return ReadDepthTargets(path, tracks.size(0), scene.height(), scene.width(), tracks.size(1));
  };
  detected->still_depth = known(StillDepthPath(folder));
  detected->part_depth = known(PartDepthPath(folder));
}

void Train(const Scene& scene, const StageRequest& request, DetectedKeyPoints detected) {
  DepthTargets depth;
  if (request.config.train.lambda_depth > 0) depth = Joined(detected.still_depth, detected.part_depth);
  TrainStage(scene, request, FieldStage::kTrain, std::move(detected), depth);
}

}  // namespace

DetectedKeyPoints ReadDetectedKeyPoints(const Scene& scene, const fs::path& folder) {
  DetectedKeyPoints detected = ReadTracks(scene, folder);
  ReadSupervision(scene, folder, &detected);
  return detected;
}

void RunTraining(const Scene& scene, const StageRequest& request, const fs::path& detection_folder) {
  CheckTraining(request.config);
  DetectedKeyPoints detected = ReadTracks(scene, detection_folder);
  Say(PlanTraining(ConfigOf(scene, request, FieldStage::kTrain), scene, request.device, detected, detection_folder));
  ReadSupervision(scene, detection_folder, &detected);
  if (detected.tracks.size(1) == 0) {
    LogWarning("{}: no key points (data/k_points_auto.txt); training a static scene", detection_folder.string());
  }
  StageRequest decided = request;
  if (Resumes(request)) {
    detected = Merged(detected, ReadMerged(DecisionsPath(request.out), detected.tracks.size(1)));
  } else {
    const ComponentTrials trials = DecideComponents(scene, request, detected);
    detected = Merged(detected, trials.merged);
    Follow(trials, FieldStage::kTrain, &decided);
  }
  Train(scene, decided, std::move(detected));
}

void RunTraining(const Scene& scene, const StageRequest& request, DetectedKeyPoints detected) {
  CheckTraining(request.config);
  Say(PlanTraining(ConfigOf(scene, request, FieldStage::kTrain), scene, request.device, detected));
  Train(scene, request, std::move(detected));
}

}  // namespace editnerf
