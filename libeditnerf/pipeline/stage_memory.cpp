#include "libeditnerf/pipeline/stage_memory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/tracking/detection_run.h"
#include "libeditnerf/training/generator_guard.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

// Bytes of a training frame's pixel, or of the flow's between it and the next.
constexpr int64_t kImage = 3, kDepthMap = 4, kGrayImage = 4, kAmbientMap = 4, kCanonicalMap = 12;
constexpr int64_t kFlowMap = 8, kFlowBothWays = 2 * (kFlowMap + 1);  // checked: a byte each

// Bytes of a place of known depth.
constexpr int64_t kPlace = 40;               // DepthTargets
constexpr int64_t kPlaceLookedFor = 24;      // while triangulated, beside two copies of what is found
constexpr int64_t kPlaceDrawn = kPlace + 8;  // TrainingRays, of distances
constexpr int64_t kPlaceSorted = 140;        // of what stands still and what is carried, while they are told apart

constexpr int64_t kPairsAtOnce = 16;  // of images, at most (flow_sequence.cpp)
// Dense inverse search and its refinement, bytes of a pixel as measured with OpenCV 4.6.
constexpr int64_t kDisSearch = 220;
// RAFT: images at an eighth of their size, kept for a block of pairs, activations, and all-pairs correlation.
constexpr int64_t kRaftImages = kPairsAtOnce + 1, kRaftFeatures = 32, kRaftActivations = 256, kRaftScale = 8;

int64_t TrainingFrames(const Scene& scene) { return static_cast<int64_t>(scene.train.size()); }
int64_t Pixels(const Scene& scene) { return scene.height() * scene.width(); }
int64_t TrainingPixels(const Scene& scene) { return TrainingFrames(scene) * Pixels(scene); }
int64_t FlowPixels(const Scene& scene) { return (TrainingFrames(scene) - 1) * Pixels(scene); }

// That TriangulateStillDepth looks for.
int64_t MostStillPlaces(const Scene& scene) {
  const int64_t spacing = std::max<int64_t>(2, std::llround(6 * static_cast<double>(scene.width()) / 320));
  return TrainingFrames(scene) * (scene.height() / spacing) * (scene.width() / spacing);
}

int64_t FlowSearch(const FlowConfig& flow, const Scene& scene) {
  const int64_t threads = std::min(NumThreads(), kPairsAtOnce);
  if (flow.method == "dis" || flow.weights.empty()) return threads * kDisSearch * Pixels(scene);
  const int64_t pixels = flow.enlarge * flow.enlarge * Pixels(scene), eighth = pixels / (kRaftScale * kRaftScale);
  const int64_t correlation = eighth * eighth * static_cast<int64_t>(sizeof(float)) * 4 / 3;  // with its pyramid
  return kRaftImages * kRaftFeatures * pixels + threads * (kRaftActivations * pixels + correlation);
}

Config WithOpenComponents(Config config) {
  FieldConfig& field = config.field;
  for (Choice* component :
       {&field.use_view_direction, &field.use_appearance, &field.warp.enabled, &field.fast.local_frames}) {
    if (*component == Choice::kAuto) *component = Choice::kOn;
  }
  return config;
}

// With key points anywhere: sizes depend on their number alone.
Run LargestRun(const Config& config, FieldStage stage, const Scene& scene, torch::Device device, int64_t key_points = 0,
               bool turns = false) {
  const GeneratorGuard guard(/*seed=*/0);
  const std::vector<int64_t> shape = {TrainingFrames(scene), key_points, 3};
  const torch::Tensor tracks = torch::linspace(0, 1, shape[0]).view({-1, 1, 1}).expand(shape).contiguous();
  return MakeRun(WithOpenComponents(config), stage, scene, tracks, device,
                 turns ? torch::zeros(shape) : torch::Tensor());
}

class Phases {
 public:
  void Begin(std::string name, MemoryPlan plan) { memory_.phases.push_back({std::move(name), std::move(plan)}); }
  void Add(const std::string& part, int64_t bytes) { memory_.phases.back().plan.parts.emplace_back(part, bytes); }
  StageMemory Take() { return std::move(memory_); }

 private:
  StageMemory memory_;
};

// Maps and known places, before they are read.
struct Supervision {
  bool maps = false;
  int64_t places = 0;
};

Supervision SupervisionIn(const fs::path& folder) {
  Supervision supervision = {HasKeyPointFiles(folder), 0};
  for (const fs::path& path : {StillDepthPath(folder), PartDepthPath(folder)}) {
    std::error_code none;
    const uintmax_t bytes = fs::file_size(path, none);
    if (supervision.maps && !none) supervision.places += static_cast<int64_t>(bytes) / kPlace;
  }
  return supervision;
}

}  // namespace

const MemoryPhase& StageMemory::Largest() const {
  return *std::max_element(phases.begin(), phases.end(),
                           [](const MemoryPhase& a, const MemoryPhase& b) { return a.plan.Total() < b.plan.Total(); });
}

StageMemory PlanPretraining(const Config& config, const Scene& scene, torch::Device device) {
  const Run run = LargestRun(config, FieldStage::kPretrain, scene, device);
  const int64_t pixels = TrainingPixels(scene), flow = kFlowBothWays * FlowPixels(scene);
  const int64_t places = config.pretrain.lambda_depth > 0 ? MostStillPlaces(scene) : 0;
  Phases phases;
  if (places > 0) {
    phases.Begin("optical flow", PlanScene(scene));
    phases.Add("training images", kImage * pixels);
    phases.Add("flow", flow);
    phases.Add("its search", FlowSearch(config.flow, scene));
    phases.Begin("static depth", PlanScene(scene));
    phases.Add("flow", flow);
    phases.Add("grey images", kGrayImage * pixels);
    phases.Add("depth maps", kDepthMap * pixels);
    phases.Add("known places", (kPlaceLookedFor + 2 * kPlace) * places);
  }
  phases.Begin("optimisation", PlanMemory(run, scene));
  phases.Add("known places", kPlaceDrawn * places);
  phases.Begin("surface maps", PlanScene(scene));
  for (const auto& [part, bytes] : PlanField(run).parts) phases.Add(part, bytes);
  phases.Add("known places", kPlace * places);
  const FieldConfig& field = run.config.field;
  const int64_t canonical = field.HasWarp() ? kCanonicalMap : 0;
  phases.Add("maps", (kDepthMap + kAmbientMap * field.slicing.AmbientDim() + canonical) * pixels);
  return phases.Take();
}

StageMemory PlanTraining(const Config& config, const Scene& scene, torch::Device device,
                         const DetectedKeyPoints& detected, const fs::path& folder) {
  const Run run = LargestRun(config, FieldStage::kTrain, scene, device, detected.tracks.size(1),
                             /*turns=*/detected.turns.defined());
  const Supervision known = folder.empty() ? Supervision{detected.supervision.has_value(),
                                                         detected.still_depth.size() + detected.part_depth.size()}
                                           : SupervisionIn(folder);
  const int64_t depth = known.maps ? kDepthMap * TrainingPixels(scene) : 0;
  const int64_t flow = known.maps ? kFlowMap * FlowPixels(scene) : 0;
  Phases phases;
  if (known.maps && !folder.empty()) {
    phases.Begin("reading key points", PlanScene(scene));
    phases.Add("depth maps", depth);
    phases.Add("flow", 2 * flow);  // pair by pair, and all of it
  }
  phases.Begin("optimisation", PlanMemory(run, scene));
  phases.Add("depth maps", depth);
  phases.Add("flow", flow);
  phases.Add("known places", (kPlaceSorted + (config.train.lambda_depth > 0 ? kPlaceDrawn : 0)) * known.places);
  return phases.Take();
}

std::vector<std::string> ToText(const StageMemory& memory) {
  const MemoryPhase& largest = memory.Largest();
  std::vector<std::string> lines = {fmt::format("memory: at most {:.0f} MiB beside LibTorch, for {}",
                                                static_cast<double>(largest.plan.Total()) / (1 << 20), largest.name)};
  for (const MemoryPhase& phase : memory.phases) {
    lines.push_back(fmt::format("memory for {}: {}", phase.name, SizesText(phase.plan)));
  }
  return lines;
}

}  // namespace editnerf
