#include "libeditnerf/pipeline/evaluate_run.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/pipeline/key_point_scores.h"
#include "libeditnerf/pipeline/stages.h"
#include "libeditnerf/render/image_renderer.h"
#include "libeditnerf/scene/timeline.h"
#include "libeditnerf/training/held_out.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

constexpr const char* kReconstruction = "reconstruction";
constexpr const char* kInterpolation = "interpolation";
constexpr const char* kEditing = "editing";

// What one protocol renders.
struct Plan {
  std::string name;
  std::vector<int64_t> frames;   // indices into scene.frames
  FrameStates states;            // a row for each
  bool trained = false;          // training saw these states: the occupancy grid knows them
  std::vector<int64_t> nearest;  // row of scene.train whose image the baseline shows; empty: no baseline
  std::vector<double> distance;  // of the nearest key points; empty but for editing
};

const SceneFrame& FrameAt(const Scene& scene, int64_t frame) { return scene.frames[static_cast<size_t>(frame)]; }

std::vector<int64_t> FramesOf(const Scene& scene, const std::string& protocol) {
  if (protocol == kEditing) return scene.edit;
  std::vector<int64_t> frames;
  for (const int64_t frame : scene.val) {
    if (LocateInTime(scene, frame).trained == (protocol == kReconstruction)) frames.push_back(frame);
  }
  return frames;
}

std::vector<int64_t> EvenlySpaced(const std::vector<int64_t>& frames, int64_t max_frames) {
  const auto count = static_cast<int64_t>(frames.size());
  if (max_frames <= 0 || count <= max_frames) return frames;
  std::vector<int64_t> chosen;
  for (int64_t i = 0; i < max_frames; ++i) {
    chosen.push_back(frames[static_cast<size_t>((2 * i + 1) * count / (2 * max_frames))]);
  }
  return chosen;
}

Plan MakePlan(Run& run, const Scene& scene, const std::string& protocol, const EvaluationRequest& request) {
  Plan plan;
  plan.name = protocol;
  plan.frames = EvenlySpaced(FramesOf(scene, protocol), request.max_frames);
  if (protocol != kEditing) {
    plan.states = StatesOfFrames(*run.field, scene, plan.frames, run.device);
    plan.trained = protocol == kReconstruction;
    if (!plan.trained) return plan;
    for (const int64_t frame : plan.frames) plan.nearest.push_back(LocateInTime(scene, frame).before);
    return plan;
  }
  const torch::Tensor tracks = TrainedTracks(run);
  const std::vector<ReferenceKeyPoint> references = ReferencesOf(scene, tracks, request.detection_folder);
  std::vector<torch::Tensor> key_points;
  for (const int64_t frame : plan.frames) {
    key_points.push_back(TrueKeyPoints(scene, references, frame));
    const NearestFrame nearest = NearestTrainingFrame(tracks, key_points.back());
    plan.nearest.push_back(nearest.train_index);
    plan.distance.push_back(nearest.distance);
  }
  plan.states = run.field->States(torch::tensor(plan.nearest, torch::kInt64).to(run.device));
  plan.states.key_points = torch::stack(key_points).to(plan.states.key_points.options());
  return plan;
}

FrameStates RowOf(const FrameStates& states, int64_t row) {
  const auto one = [row](const torch::Tensor& table) { return table.defined() ? table.narrow(0, row, 1) : table; };
  return {one(states.warp_code), one(states.appearance_code), one(states.key_points)};
}

torch::Tensor AsFloat(const torch::Tensor& image) { return image.to(torch::kFloat32) / 255; }

torch::Tensor SideBySide(const torch::Tensor& truth, const torch::Tensor& rendered) {
  const torch::Tensor right = (rendered.nan_to_num(0) * 255).round().clamp(0, 255).to(torch::kUInt8);
  return torch::cat({truth, right}, 1);
}

}  // namespace

const std::vector<std::string>& EvaluationProtocols() {
  static const std::vector<std::string> protocols = {kReconstruction, kInterpolation, kEditing};
  return protocols;
}

std::string ReasonAgainst(const Run& run, const Scene& scene, const std::string& protocol) {
  const auto& known = EvaluationProtocols();
  if (std::find(known.begin(), known.end(), protocol) == known.end()) {
    Throw<ConfigError>("protocol '{}': expected reconstruction, interpolation or editing", protocol);
  }
  if (protocol == kEditing) {
    if (run.stage == FieldStage::kPretrain)
      return "a pretrained run has no key points to edit; train it with enf-train";
    if (run.field->num_key_points() == 0) return "the run has no key points to edit";
    if (!HasMasks(scene))
      return "the scene has no ground truth (gt/motion.json and gt/mask); only synthetic scenes have";
  }
  if (!FramesOf(scene, protocol).empty()) return "";
  if (protocol == kEditing) return "the scene has no edit frames (gt/edits.json)";
  if (scene.val.empty()) return "the scene has no held-out frames (val_ids, or data.hold_out when it was trained)";
  return protocol == kReconstruction ? "no held-out frame shows the state of a training frame from another camera"
                                     : "every held-out frame shows the state of a training frame";
}

EvaluationResult EvaluateRun(Run& run, const Scene& scene, const EvaluationRequest& request) {
  const torch::NoGradGuard no_grad;
  CheckSameScene(run, scene);
  for (const std::string& protocol : request.protocols) {
    const std::string reason = ReasonAgainst(run, scene, protocol);
    if (!reason.empty()) Throw<DataError>("{}: {}: {}", scene.name, protocol, reason);
  }
  if (!request.pictures.empty()) MakeFolder(request.pictures);
  run.field->eval();

  std::vector<Plan> plans;
  int64_t total = 0;
  for (const std::string& protocol : EvaluationProtocols()) {
    if (request.protocols.count(protocol) == 0) continue;
    plans.push_back(MakePlan(run, scene, protocol, request));
    total += static_cast<int64_t>(plans.back().frames.size());
  }
  EvaluationResult result;
  result.num_key_points = run.field->num_key_points();
  const std::string stage = run.stage == FieldStage::kPretrain ? "pretrain" : "train";
  result.stage_seconds = {{stage, run.counters.seconds_total}, {stage + "_only", run.counters.seconds_training}};
  if (total == 0) return result;

  Progress bar("evaluation", static_cast<double>(total));
  ImageOptions options;
  options.tensor = torch::TensorOptions(torch::kFloat32).device(run.device);
  int64_t done = 0;
  for (const Plan& plan : plans) {
    const auto count = static_cast<int64_t>(plan.frames.size());
    for (int64_t i = 0; !plan.trained && i < count; ++i) {
      if (InterruptRequested()) Throw<Interrupted>("evaluation stopped by request");
      run.renderer->CoverStates(*run.field, RowOf(plan.states, i));
    }
    ProtocolResult rendered = {plan.name, {}}, baseline = {plan.name + "_nearest", {}};
    for (int64_t i = 0; i < count; ++i) {
      const auto index = static_cast<size_t>(i);
      const int64_t frame = plan.frames[index];
      const SceneFrame& view = FrameAt(scene, frame);
      const torch::Tensor truth = AsFloat(scene.images[frame]);
      const torch::Tensor moving = HasMasks(scene) ? scene.truth->mask[frame] > 0 : torch::Tensor();
      const torch::Tensor image = RenderImage(*run.field, *run.renderer, view.camera, RowOf(plan.states, i), options)
                                      .rgb.to(torch::kCPU)
                                      .clamp(0, 1);
      rendered.frames.push_back(MeasureFrame(view.id, image, truth, moving, request.lpips));
      if (!plan.distance.empty()) rendered.frames.back().metrics["key_point_distance"] = plan.distance[index];
      if (!plan.nearest.empty()) {
        const int64_t shown = scene.train[static_cast<size_t>(plan.nearest[index])];
        baseline.frames.push_back(MeasureFrame(view.id, AsFloat(scene.images[shown]), truth, moving, request.lpips));
      }
      if (!request.pictures.empty()) {
        WritePng(request.pictures / (plan.name + "_" + view.id + ".png"), SideBySide(scene.images[frame], image));
      }
      bar.Update(static_cast<double>(++done), fmt::format("{:.2f} dB", rendered.frames.back().metrics["psnr"]));
    }
    result.protocols.push_back(std::move(rendered));
    if (!baseline.frames.empty()) result.protocols.push_back(std::move(baseline));
  }
  bar.Finish();
  return result;
}

}  // namespace editnerf
