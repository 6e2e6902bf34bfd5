#include "libeditnerf/benchmarks/tables_benchmark.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <functional>
#include <utility>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/benchmarks/ablation_ladder.h"
#include "libeditnerf/benchmarks/bench_scene.h"
#include "libeditnerf/benchmarks/tables_layout.h"
#include "libeditnerf/evaluation/flow_error.h"
#include "libeditnerf/pipeline/evaluate_run.h"
#include "libeditnerf/pipeline/key_point_scores.h"
#include "libeditnerf/pipeline/stages.h"
#include "libeditnerf/tracking/detection_run.h"
#include "libeditnerf/tracking/flow_cache.h"
#include "libeditnerf/tracking/flow_choice.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kFlowPairs = 12;
constexpr int64_t kPaperFrames = 4;  // of each protocol: a picture takes minutes

Json ToJson(const std::vector<DepthError>& errors) {
  Json json = Json::object();
  for (const DepthError& error : errors) {
    json[error.part] = {{"median", error.median}, {"percentile90", error.percentile90}, {"pixels", error.pixels}};
  }
  return json;
}

// One scene with one seed: everything in a folder of its own.
class SceneRun {
 public:
  SceneRun(const Scene& scene, std::string source, const Config& config, const TablesBenchmark& options,
           fs::path folder)
      : scene_(scene),
        source_(std::move(source)),
        config_(config),
        options_(options),
        folder_(std::move(folder)),
        flow_(MakeOpticalFlow(config.flow)) {}

  // {"rows": {NAME: scores}, "depth": {...}, "flow": [...], "ladder": [{"name", "description"}]}
  Json Measure(int64_t seed) {
    torch::manual_seed(static_cast<uint64_t>(seed));
    Json rows = Json::object();
    rows["hypernerf"] = Row("pretrained", config_, options_.max_frames,
                            [&](const StageRequest& request) { RunPretraining(scene_, request); });
    const DetectedKeyPoints detected = Detect("detection", config_.detect);
    const Json ladder = options_.ladder ? MeasureLadder(seed, detected, &rows) : Json::array();
    if (ladder.empty()) rows["fast"] = TrainedRow("fast", seed, config_, detected, "detection", options_.max_frames);
    if (!ladder.empty()) rows["fast"] = rows.at(ladder.back().at("name").get<std::string>());
    if (options_.paper_seconds > 0) rows["paper"] = PaperRow(seed, detected);
    Json json = {{"seed", seed}, {"rows", std::move(rows)}, {"ladder", ladder}};
    json["key_points"] = detected.tracks.size(1);
    json["known_depth"] = ToJson(MeasureDepthTargets(scene_, detected.part_depth));
    json["flow"] = scene_.truth ? MeasureFlow() : Json::array();
    return json;
  }

 private:
  using Work = std::function<void(const StageRequest&)>;

  // The scores of a run, which is made unless it is finished.
  Json Row(const std::string& name, const Config& config, int64_t max_frames, const Work& work,
           const std::string& detection = "detection") {
    const fs::path out = folder_ / name, scores = out / "scores.json";
    if (fs::exists(scores)) return ReadJson(scores);
    LogInfo("{}", out.string());
    StageRequest request;
    request.scene_folder = source_;
    request.out = out;
    request.config = config;
    request.device = options_.device;
    request.resume = true;
    work(request);
    Run run = LoadRun(out, options_.device);
    EvaluationRequest evaluation;
    evaluation.lpips = options_.lpips;
    evaluation.max_frames = max_frames;
    evaluation.detection_folder = folder_ / detection;
    for (const std::string& protocol : EvaluationProtocols()) {
      if (ReasonAgainst(run, scene_, protocol).empty()) evaluation.protocols.insert(protocol);
    }
    const Stopwatch clock;
    Json json = editnerf::ToJson(EvaluateRun(run, scene_, evaluation));
    json["seconds.evaluation"] = clock.Seconds();
    json.update(editnerf::ToJson(MeasureKeyPoints(run, scene_, evaluation.detection_folder)));
    if (scene_.truth && config.render.sampler == "occupancy") json["depth"] = ToJson(MeasureDepth(run, scene_));
    WriteJson(scores, json);
    return json;
  }

  Json TrainedRow(const std::string& name, int64_t seed, const Config& config, const DetectedKeyPoints& detected,
                  const std::string& detection, int64_t max_frames) {
    torch::manual_seed(static_cast<uint64_t>(seed));
    const auto train = [&](const StageRequest& request) { RunTraining(scene_, request, detected); };
    return Row(name, config, max_frames, train, detection);
  }

  Json PaperRow(int64_t seed, DetectedKeyPoints detected) {
    Config config = options_.paper;
    config.train.seconds = options_.paper_seconds;
    config.train.rays_per_step = std::min(config.train.rays_per_step, kPaperRays);
    detected.turns = torch::Tensor();
    return TrainedRow("paper", seed, config, detected, "detection", kPaperFrames);
  }

  Json MeasureLadder(int64_t seed, const DetectedKeyPoints& refined, Json* rows) {
    const int64_t count = refined.tracks.size(1);
    if (count == 0 || !HasMasks(scene_)) return Json::array();
    LadderKeyPoints volume;
    volume.detected = Detect("volume", VolumeDetection(config_.detect, count));
    volume.reference = torch::zeros({volume.detected.tracks.size(1), 3});
    const auto references = ReferencesOf(scene_, volume.detected.tracks, folder_ / "volume");
    for (size_t i = 0; i < references.size(); ++i) {
      const Vec3& at = references[i].position;
      volume.reference[static_cast<int64_t>(i)] = torch::tensor({at.x, at.y, at.z}).to(torch::kFloat32);
    }
    Json ladder = Json::array();
    for (const LadderStep& step : AblationLadder(config_, volume, refined)) {
      (*rows)[step.name] = TrainedRow(step.name, seed, step.config, step.detected,
                                      step.from_volume ? "volume" : "detection", options_.max_frames);
      ladder.push_back({{"name", step.name}, {"description", step.description}});
    }
    return ladder;
  }

  DetectedKeyPoints Detect(const std::string& name, DetectionConfig detection) {
    const fs::path out = folder_ / name;
    if (!fs::exists(out / "data" / "detection.json")) {
      const PretrainedMaps maps = ReadPretrainedMaps(folder_ / "pretrained", scene_);
      const auto run = [&] {
        return RunDetection(scene_, maps, detection, *flow_, FlowCachePath(folder_ / "pretrained"));
      };
      DetectionRun found;
      try {
        found = run();
      } catch (const ConfigError& error) {  // more key points are asked for than the volume has maxima
        if (detection.count == 0) throw;
        LogWarning("{}: {}", out.string(), error.what());
        detection.count = 0;
        found = run();
      }
      WriteDetection(scene_, found, out);
    }
    return ReadDetectedKeyPoints(scene_, out);
  }

  Json MeasureFlow() const {
    const DisFlow dis;
    std::vector<const OpticalFlow*> flows = {&dis};
    if (flow_->Name() != dis.Name()) flows.push_back(flow_.get());
    const auto frames = static_cast<int64_t>(scene_.train.size());
    Json json = Json::array();
    for (const OpticalFlow* flow : flows) {
      FlowErrors errors;
      for (int64_t i = 0; i < std::min(kFlowPairs, frames - 1); ++i) {
        const auto row = static_cast<size_t>((2 * i + 1) * (frames - 1) / (2 * std::min(kFlowPairs, frames - 1)));
        const int64_t from = scene_.train[row], to = scene_.train[row + 1];
        errors.Add(flow->Flow(scene_.images[from], scene_.images[to]), scene_, from, to);
      }
      Json parts = Json::object();
      for (const FlowError& error : errors.Summary()) {
        parts[kFlowPartNames.at(static_cast<size_t>(error.part))] = {
            {"median", error.median}, {"percentile90", error.percentile90}, {"pixels", error.pixels}};
      }
      json.push_back({{"name", flow->Name()}, {"parts", std::move(parts)}});
    }
    return json;
  }

  const Scene& scene_;
  std::string source_;
  const Config& config_;
  const TablesBenchmark& options_;
  fs::path folder_;
  std::unique_ptr<OpticalFlow> flow_;
};

}  // namespace

BenchmarkResult RunTablesBenchmark(const Config& config, const TablesBenchmark& options) {
  CheckTraining(config);
  if (options.scenes.empty()) Throw<ConfigError>("tables: expected at least one scene, found none");
  BenchmarkResult result;
  result.json = {{"seeds", options.seeds}, {"scenes", Json::array()}};
  for (const std::string& source : options.scenes) {
    const BenchScene bench = OpenBenchScene(source, options.synthetic, config.data);
    Json seeds = Json::array();
    for (const int64_t seed : options.seeds) {
      const fs::path folder = options.folder / bench.scene.name / ("seed_" + std::to_string(seed));
      MakeFolder(folder);
      seeds.push_back(SceneRun(bench.scene, source, config, options, folder).Measure(seed));
    }
    result.json["scenes"].push_back({{"name", bench.scene.name}, {"source", source}, {"seeds", std::move(seeds)}});
  }
  result.tables = LayOutTables(result.json);
  return result;
}

}  // namespace editnerf
