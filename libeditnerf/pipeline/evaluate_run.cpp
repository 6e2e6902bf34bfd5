#include "libeditnerf/pipeline/evaluate_run.h"

#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
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
const SceneFrame& TrainingFrame(const Scene& scene, int64_t row) {
  return FrameAt(scene, scene.train[static_cast<size_t>(row)]);
}

bool HasMasks(const Scene& scene) { return scene.truth && scene.truth->mask.defined(); }

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

void CheckSameScene(const Run& run, const Scene& scene) {
  const SceneTransform &a = run.scene.transform, &b = scene.transform;
  const bool same_units =
      std::abs(a.scale - b.scale) <= 1e-6 * std::abs(a.scale) && Norm(a.center - b.center) * std::abs(a.scale) <= 1e-6;
  bool same_frames = run.scene.train.size() == scene.train.size();
  for (int64_t row = 0; same_frames && row < static_cast<int64_t>(scene.train.size()); ++row) {
    same_frames = TrainingFrame(run.scene, row).id == TrainingFrame(scene, row).id;
  }
  if (!same_units || !same_frames) {
    Throw<DataError>("{}: not the scene of this run: its {} differ; give the scene that the run was trained on",
                     scene.name, same_units ? "training frames" : "scale or center");
  }
}

// All key points that training left, [T, N, 3] float64 on the CPU.
torch::Tensor TrainedTracks(Run& run) {
  const torch::Tensor time = torch::arange(static_cast<int64_t>(run.scene.train.size()), torch::kInt64).to(run.device);
  return run.field->key_points()->Positions(time).detach().to(torch::kCPU, torch::kFloat64).contiguous();
}

Vec3 PositionAt(const torch::Tensor& tracks, int64_t row, int64_t key_point) {
  const auto values = tracks.accessor<double, 3>()[row][key_point];
  return {values[0], values[1], values[2]};
}

// Rows of scene.train in which detection found the key points; empty where its file is absent or of other key points.
std::vector<int64_t> DetectedReferenceRows(const Scene& scene, int64_t num_key_points, const fs::path& folder) {
  const fs::path path = folder / "data" / "detection.json";
  if (folder.empty() || !fs::exists(path)) return {};
  const Json json = ReadJson(path);
  const Json& points = JsonField(json, "key_points", path.string());
  if (!points.is_array() || static_cast<int64_t>(points.size()) != num_key_points) {
    LogWarning("{}: not of this run, which has {} key points; taking their reference frames from the ground truth",
               path.string(), num_key_points);
    return {};
  }
  std::vector<int64_t> rows;
  for (const Json& point : points) {
    const Json& id = JsonField(point, "reference_frame", path.string());
    const auto found = std::find_if(scene.train.begin(), scene.train.end(), [&](int64_t frame) {
      return id.is_string() && FrameAt(scene, frame).id == id.get<std::string>();
    });
    if (found == scene.train.end()) {
      Throw<DataError>("{}: reference_frame: expected the id of a training frame, found {}", path.string(), id.dump());
    }
    rows.push_back(found - scene.train.begin());
  }
  return rows;
}

// The training frame in which a key point is closest to the visible surface of a moving object; the first for a key
// point that is never seen on one.
int64_t RowOnSurface(const Scene& scene, const torch::Tensor& tracks, int64_t key_point) {
  const torch::Tensor& depth = scene.truth->depth;
  int64_t best = 0;
  double smallest = std::numeric_limits<double>::infinity();
  for (int64_t row = 0; row < tracks.size(0); ++row) {
    const int64_t frame = scene.train[static_cast<size_t>(row)];
    const Vec3 position = PositionAt(tracks, row, key_point);
    if (ObjectAt(scene, frame, position) == kStaticObject) continue;
    double gap = 0;
    if (depth.defined()) {
      const Camera& camera = FrameAt(scene, frame).camera;
      const Projected pixel = Project(camera, position);
      const auto u = static_cast<int64_t>(pixel.u), v = static_cast<int64_t>(pixel.v);  // inside: it has an object
      gap = std::abs(depth[frame][v][u].item<double>() - Norm(position - camera.position));
    }
    if (gap < smallest) smallest = gap, best = row;
  }
  return best;
}

std::vector<ReferenceKeyPoint> ReferencesOf(const Scene& scene, const torch::Tensor& tracks, const fs::path& folder) {
  std::vector<int64_t> rows = DetectedReferenceRows(scene, tracks.size(1), folder);
  for (auto n = static_cast<int64_t>(rows.size()); n < tracks.size(1); ++n) {
    rows.push_back(RowOnSurface(scene, tracks, n));
  }
  std::vector<ReferenceKeyPoint> references;
  for (int64_t n = 0; n < tracks.size(1); ++n) {
    const int64_t row = rows[static_cast<size_t>(n)], frame = scene.train[static_cast<size_t>(row)];
    const Vec3 position = PositionAt(tracks, row, n);
    references.push_back({position, frame, ObjectAt(scene, frame, position)});
  }
  return references;
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

std::vector<KeyPointScore> MeasureKeyPoints(Run& run, const Scene& scene, const fs::path& detection_folder) {
  const torch::NoGradGuard no_grad;
  if (run.field->num_key_points() == 0 || !HasMasks(scene)) return {};
  CheckSameScene(run, scene);
  const torch::Tensor tracks = TrainedTracks(run);
  const std::vector<ReferenceKeyPoint> references = ReferencesOf(scene, tracks, detection_folder);
  std::vector<torch::Tensor> rows;
  for (const int64_t frame : scene.train) rows.push_back(TrueKeyPoints(scene, references, frame));
  const torch::Tensor truth = torch::stack(rows);                                // [T, N, 3]
  const torch::Tensor distances = (tracks - truth).norm(2, 2).t().contiguous();  // [N, T]
  std::vector<KeyPointScore> scores;
  for (size_t i = 0; i < references.size(); ++i) {
    const auto n = static_cast<int64_t>(i);
    const torch::Tensor path = truth.select(1, n);
    const double* first = distances[n].data_ptr<double>();
    KeyPointScore score;
    score.reference = references[i];
    if (score.reference.object != kStaticObject) {
      score.object = scene.truth->objects[static_cast<size_t>(score.reference.object)];
    }
    score.distances.assign(first, first + distances.size(1));
    score.motion_range = (path.unsqueeze(0) - path.unsqueeze(1)).norm(2, 2).max().item<double>();
    scores.push_back(std::move(score));
  }
  return scores;
}

nlohmann::json ToJson(const std::vector<KeyPointScore>& scores) {
  auto json = nlohmann::json::object();
  if (scores.empty()) return json;
  const auto median = [](std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();  // null in the file
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  std::vector<double> distances, shares;
  int64_t on_moving_part = 0;
  auto objects = nlohmann::json::array();
  for (const KeyPointScore& score : scores) {
    distances.insert(distances.end(), score.distances.begin(), score.distances.end());
    objects.push_back(score.object.empty() ? nlohmann::json() : nlohmann::json(score.object));
    if (score.object.empty()) continue;
    ++on_moving_part;
    for (const double distance : score.distances) {
      if (score.motion_range > 0) shares.push_back(distance / score.motion_range);
    }
  }
  json["key_points.on_moving_part"] = on_moving_part;
  json["key_points.objects"] = std::move(objects);
  json["key_points.error"] = median(std::move(distances));
  json["key_points.error_share"] = median(std::move(shares));
  return json;
}

}  // namespace editnerf
