#include "libeditnerf/training/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/json_text.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/scene/scene_json.h"
#include "libeditnerf/training/step_guard.h"
#include "libeditnerf/training/training_rays.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;
using Tensors = std::map<std::string, torch::Tensor>;

constexpr const char* kFormat = "editnerf checkpoint";
constexpr int kVersion = 4;
// The local occupancy grid covers the whole reach of a part's own coordinates, not the share that the local hash
// encoding refines.
constexpr double kLocalReach = 1.0;

// Everything between near and far of the training views, from the corners and edges of their images.
Box BoxOf(const Scene& scene) {
  std::vector<Camera> cameras;
  for (const int64_t frame : scene.train) cameras.push_back(scene.frames[static_cast<size_t>(frame)].camera);
  const CameraTensors tensors = StackCameras(cameras);
  const torch::Tensor edge = torch::linspace(0, 1, 5);
  const torch::Tensor u = edge.repeat({5}) * static_cast<double>(tensors.width);
  const torch::Tensor v = edge.repeat_interleave(5) * static_cast<double>(tensors.height);
  const torch::Tensor frame = torch::arange(tensors.size()).repeat_interleave(25);
  const Rays rays = RaysThroughPixels(tensors, frame, torch::stack({u, v}, 1).repeat({tensors.size(), 1}));
  return BoxAroundRays(rays.origin, rays.direction, scene.transform.near, scene.transform.far);
}

std::string BoxToJson(const Box& box) {
  return nlohmann::json{box.low.x, box.low.y, box.low.z, box.high.x, box.high.y, box.high.z}.dump();
}

Box BoxFromJson(const std::string& text) {
  const auto v = nlohmann::json::parse(text).get<std::array<double, 6>>();
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

struct KeyPointSetup {
  int64_t count = 0;
  torch::Tensor tracks, turns;
  bool local_frames = false;
  std::optional<Vec3> lamp{};
};

void Build(Run* run, const Box& box, const KeyPointSetup& key_points) {
  HyperspaceFieldOptions options;
  options.config = run->config.field;
  options.stage = run->stage;
  options.num_frames = static_cast<int64_t>(run->scene.train.size());
  options.box = box;
  options.num_key_points = key_points.count;
  options.initial_tracks = key_points.tracks;
  options.initial_turns = key_points.turns;
  options.local_frames = key_points.local_frames;
  options.lamp = key_points.lamp;
  run->field = std::make_shared<HyperspaceField>(options);
  std::optional<Box> local_box;
  if (run->field->has_rigid_anchor()) {
    const double reach = kLocalReach * box.LongestSide();
    local_box = Box{{-reach, -reach, -reach}, {reach, reach, reach}};
  }
  run->renderer = std::make_shared<RayRenderer>(run->config.render, run->scene.transform.near, run->scene.transform.far,
                                                box, local_box);
  run->field->to(run->device);
  run->renderer->to(run->device);
}

void Collect(const torch::nn::Module& module, const std::string& prefix, Tensors* tensors) {
  for (const auto& item : module.named_parameters()) (*tensors)[prefix + item.key()] = item.value().detach();
  for (const auto& item : module.named_buffers()) (*tensors)[prefix + item.key()] = item.value();
}

void Restore(const torch::nn::Module& module, const std::string& prefix, const Tensors& tensors, Weights weights,
             const fs::path& path) {
  const torch::NoGradGuard no_grad;
  const auto restore = [&](const std::string& key, const torch::Tensor& target) {
    const auto found = tensors.find(prefix + key);
    if (found == tensors.end()) Throw<CheckpointError>("{}: tensor '{}' is missing", path.string(), prefix + key);
    if (found->second.sizes() != target.sizes()) {
      Throw<CheckpointError>("{}: tensor '{}': expected shape {}, found {}", path.string(), prefix + key,
                             ShapeString(target), ShapeString(found->second));
    }
    if (weights == Weights::kFinite && found->second.is_floating_point() &&
        !found->second.isfinite().all().item<bool>()) {
      Throw<CheckpointError>("{}: tensor '{}' holds values that are not finite", path.string(), prefix + key);
    }
    target.copy_(found->second);
  };
  for (const auto& item : module.named_parameters()) restore(item.key(), item.value());
  for (const auto& item : module.named_buffers()) restore(item.key(), item.value());
}

std::string CountersToJson(const RunCounters& c) {
  return nlohmann::json{{"step", c.step},
                        {"rays", c.rays},
                        {"samples", c.samples},
                        {"seconds_training", c.seconds_training},
                        {"seconds_total", c.seconds_total},
                        {"skipped", c.skipped},
                        {"rolled_back", c.rolled_back},
                        {"not_finite", c.not_finite}}
      .dump();
}

RunCounters CountersFromJson(const std::string& text) {
  const auto value = nlohmann::json::parse(text);
  const auto count = [&value](const char* key) { return WholeNumber(value.at(key), key); };
  RunCounters c;
  c.step = count("step"), c.rays = count("rays"), c.samples = count("samples");
  c.seconds_training = value.at("seconds_training"), c.seconds_total = value.at("seconds_total");
  // Checkpoints from before they were counted have none of these.
  if (value.contains("skipped")) c.skipped = count("skipped");
  if (value.contains("rolled_back")) c.rolled_back = count("rolled_back");
  c.not_finite = value.value("not_finite", c.not_finite);
  return c;
}

// Numbers between the hidden layers of a network.
int64_t BetweenLayers(int64_t depth, int64_t width) { return (depth - 1) * width * width; }

int64_t Entries(const HashEncodingConfig& hash) {
  return (hash.num_levels << hash.log2_table_size) * hash.features_per_level;
}

// Numbers that a run of this configuration has at least: whatever of it can be large.
int64_t FewestNumbers(const Config& config, FieldStage stage, int64_t key_points) {
  const FieldConfig& field = config.field;
  const bool pretrain = stage == FieldStage::kPretrain;
  int64_t numbers = 0;
  if (field.kind == "fast") {
    const FastFieldConfig& fast = field.fast;
    numbers += Entries(fast.canonical_hash) + BetweenLayers(fast.density_depth, fast.width) +
               BetweenLayers(fast.color_depth, fast.width);
    if (!pretrain && key_points > 0) numbers += Entries(fast.local_hash);
    if (!pretrain && key_points > 1 && fast.shade) numbers += Entries(fast.shade_hash);
  } else {
    numbers += 2 * BetweenLayers(field.nerf.depth, field.nerf.width);  // coarse and fine
  }
  if (field.HasWarp()) numbers += BetweenLayers(field.warp.depth, field.warp.width);
  if (pretrain) numbers += BetweenLayers(field.slicing.depth, field.slicing.width);
  if (!pretrain && key_points > 1) numbers += BetweenLayers(field.weights.depth, field.weights.width);
  const int64_t cells = config.render.occupancy_resolution;
  if (config.render.sampler == "occupancy") numbers += cells * cells * cells;
  return numbers;
}

// Before memory is taken for what the configuration announces.
void CheckSize(const Run& run, int64_t key_points, const Tensors& tensors, const fs::path& path) {
  int64_t numbers = 0;
  for (const auto& item : tensors) numbers += item.second.numel();
  const int64_t fewest = FewestNumbers(run.config, run.stage, key_points);
  if (numbers < fewest) {
    Throw<CheckpointError>("{}: {} numbers in its tensors, expected at least {} for its configuration", path.string(),
                           numbers, fewest);
  }
}

FieldStage StageFrom(const std::string& text, const fs::path& path) {
  if (text == "pretrain") return FieldStage::kPretrain;
  if (text == "train") return FieldStage::kTrain;
  Throw<CheckpointError>("{}: expected stage 'pretrain' or 'train', found '{}'", path.string(), text);
}

// Pictures differ by the rounding of bfloat16 alone, so that a run can be looked at where it could not be trained.
void TakeKernelHere(Config* config) {
  std::string& kernel = config->field.fast.kernel;
  if (kernel != "bf16" || FastestBf16() != Bf16Unit::kNone) return;
  LogInfo("the run was trained with field.fast.kernel: bf16, which this processor has not; it is shown with fp32");
  kernel = "fp32";
}

}  // namespace

void RunCounters::AddSkipped(const std::vector<std::string>& what) {
  ++skipped;
  for (const std::string& name : what) ++not_finite[name];
}

std::string SkippedText(const RunCounters& counters) {
  std::vector<std::string> what;
  for (const auto& [name, times] : counters.not_finite) what.push_back(fmt::format("{} {}", name, times));
  // Loss terms before the gradients that they spoil.
  std::stable_partition(what.begin(), what.end(),
                        [](const std::string& name) { return name.find("gradient of ") != 0; });
  std::string text =
      fmt::format("{} of {} steps were skipped, not being finite ({})", counters.skipped, counters.step, ListOf(what));
  if (counters.rolled_back > 0) text += fmt::format("; training went back {} times", counters.rolled_back);
  return text;
}

Run MakeRun(const Config& config, FieldStage stage, const Scene& scene, const torch::Tensor& initial_tracks,
            torch::Device device, const torch::Tensor& initial_turns, const std::optional<Vec3>& lamp) {
  Run run;
  run.config = config;
  run.stage = stage;
  run.scene = scene;
  run.scene.images = torch::Tensor();
  run.scene.truth.reset();
  run.device = device;
  KeyPointSetup key_points;
  if (initial_tracks.defined()) key_points = {initial_tracks.size(1), initial_tracks, {}, false, lamp};
  const bool frames = config.field.HasLocalFrames() && key_points.count > 0;
  if (frames) key_points.turns = initial_turns;
  Build(&run, BoxOf(scene), key_points);
  return run;
}

void SaveRun(const Run& run, const fs::path& folder, const Tensors& extra) {
  MakeFolder(folder);
  Tensors tensors;
  Collect(*run.field, "field.", &tensors);
  Collect(*run.renderer, "renderer.", &tensors);
  for (const auto& [name, tensor] : extra) tensors["extra." + name] = tensor;
  WriteSafetensors(folder / "checkpoint.safetensors", tensors,
                   {{"format", kFormat},
                    {"version", std::to_string(kVersion)},
                    {"stage", run.stage == FieldStage::kPretrain ? "pretrain" : "train"},
                    {"config", ToYaml(run.config)},
                    {"scene", SceneToJson(run.scene)},
                    {"scene_path", run.scene_path},
                    {"box", BoxToJson(run.field->options().box)},
                    {"key_points", std::to_string(run.field->num_key_points())},
                    {"local_frames", run.field->has_local_frames() ? "yes" : "no"},
                    {"counters", CountersToJson(run.counters)}});
  WriteFileAtomically(folder / "config.yaml", ToYaml(run.config));
}

namespace {

LoadedRun Load(const fs::path& folder, torch::Device device, bool to_train, Weights weights) {
  const fs::path path = folder / "checkpoint.safetensors";
  if (!fs::exists(path)) {
    Throw<CheckpointError>("{}: no checkpoint here; expected the folder that enf-pretrain or enf-train wrote (--out)",
                           path.string());
  }
  SafetensorsFile file = ReadSafetensors(path);
  const auto text = [&](const char* key) -> const std::string& {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end()) {
      Throw<CheckpointError>("{}: not a checkpoint of this program: metadata '{}' is missing", path.string(), key);
    }
    return found->second;
  };
  if (text("format") != kFormat) {
    Throw<CheckpointError>("{}: expected format '{}', found '{}'", path.string(), kFormat, text("format"));
  }
  if (text("version") != std::to_string(kVersion)) {
    Throw<CheckpointError>("{}: expected version {}, found {}; train again, or use the program that wrote it",
                           path.string(), kVersion, text("version"));
  }
  LoadedRun loaded;
  Run& run = loaded.run;
  try {
    run.config = LoadConfigText(text("config"), path.string() + " (config)");
    if (!to_train) TakeKernelHere(&run.config);
    run.stage = StageFrom(text("stage"), path);
    run.scene = SceneFromJson(text("scene"), path.string());
    run.scene_path = text("scene_path");
    run.counters = CountersFromJson(text("counters"));
    run.device = device;
    const int64_t key_points = std::stoll(text("key_points"));
    if (key_points < 0 || key_points > 64) {
      Throw<CheckpointError>("{}: expected 0 to 64 key points, found {}", path.string(), key_points);
    }
    CheckSize(run, key_points, file.tensors, path);
    Build(&run, BoxFromJson(text("box")), {key_points, {}, {}, text("local_frames") == "yes"});
  } catch (const nlohmann::json::exception& error) {
    Throw<CheckpointError>("{}: damaged metadata: {}", path.string(), error.what());
  } catch (const std::logic_error& error) {
    Throw<CheckpointError>("{}: damaged metadata: {}", path.string(), error.what());
  } catch (const ConfigError& error) {
    Throw<CheckpointError>("{}", error.what());
  } catch (const DataError& error) {
    Throw<CheckpointError>("{}", error.what());
  }
  // Checkpoints from before shade was turned to the light have it along the scene's axes.
  file.tensors.emplace("field.fine.shade_axes", torch::eye(3));
  Restore(*run.field, "field.", file.tensors, weights, path);
  Restore(*run.renderer, "renderer.", file.tensors, weights, path);
  const std::string prefix = "extra.";
  for (const auto& [name, tensor] : file.tensors) {
    if (name.rfind(prefix, 0) == 0) loaded.extra[name.substr(prefix.size())] = tensor;
  }
  run.field->SetStep(run.counters.step);
  run.field->eval();
  return loaded;
}

}  // namespace

LoadedRun LoadRunWithExtra(const fs::path& folder, torch::Device device, Weights weights) {
  return Load(folder, device, /*to_train=*/true, weights);
}

Run LoadRun(const fs::path& folder, torch::Device device) {
  return Load(folder, device, /*to_train=*/false, Weights::kFinite).run;
}

RunCounters LoadCounters(const fs::path& folder) {
  const fs::path path = folder / "checkpoint.safetensors";
  try {
    return CountersFromJson(ReadSafetensorsMetadata(path).at("counters"));
  } catch (const std::exception& error) {
    Throw<CheckpointError>("{}: expected a checkpoint with counters: {}", path.string(), error.what());
  }
}

}  // namespace editnerf
