// enf-eval RUN --protocol P --json FILE: scores of a run against the held-out frames and the ground truth of its scene.
#include <algorithm>
#include <filesystem>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/pipeline/evaluate_run.h"
#include "libeditnerf/pipeline/key_point_scores.h"
#include "libeditnerf/pipeline/stages.h"
#include "support/run.h"

namespace {

using namespace editnerf;
namespace fs = std::filesystem;

struct Arguments {
  fs::path run, scene, key_points, json, pictures, lpips_backbone, lpips_linear;
  std::string protocol = "all";
  int64_t max_frames = 0;
};

std::set<std::string> Chosen(const Run& run, const Scene& scene, const std::string& protocol) {
  if (protocol != "all") return {protocol};
  std::set<std::string> chosen;
  std::string reasons;
  for (const std::string& candidate : EvaluationProtocols()) {
    const std::string reason = ReasonAgainst(run, scene, candidate);
    if (reason.empty()) {
      chosen.insert(candidate);
    } else {
      LogInfo("{} left out: {}", candidate, reason);
      reasons += fmt::format("\n  {}: {}", candidate, reason);
    }
  }
  if (chosen.empty()) Throw<DataError>("{}: nothing to evaluate:{}", scene.name, reasons);
  return chosen;
}

// The other stages' seconds, as the driver `enf` leaves them in the run folder or beside it.
void AddStageSeconds(const fs::path& run, EvaluationResult* result) {
  for (const fs::path& path : {run / "stages.json", run / ".." / "stages.json"}) {
    if (!fs::exists(path)) continue;
    const Json stages = ReadJson(path);
    for (const auto& item : stages.items()) {
      const bool known = std::any_of(result->stage_seconds.begin(), result->stage_seconds.end(),
                                     [&](const auto& stage) { return stage.first == item.key(); });
      if (!known) result->stage_seconds.emplace_back(item.key(), JsonNumber(stages, item.key(), path.string()));
    }
    return;
  }
}

void LogTable(const EvaluationResult& result) {
  const std::vector<const char*> metrics = {"psnr", "psnr_moving", "ssim", "ms_ssim", "lpips"};
  std::string header = fmt::format("{:<24}{:>8}", "", "frames");
  for (const char* metric : metrics) header += fmt::format("{:>13}", metric);
  LogInfo("{}", header);
  for (const ProtocolResult& protocol : result.protocols) {
    const auto means = protocol.Means();
    std::string row = fmt::format("{:<24}{:>8}", protocol.name, protocol.frames.size());
    for (const char* metric : metrics) {
      const auto found = means.find(metric);
      row += found == means.end() ? fmt::format("{:>13}", "-") : fmt::format("{:>13.4f}", found->second);
    }
    LogInfo("{}", row);
  }
}

void Evaluate(const Arguments& arguments, const CommonOptions& common) {
  Run run = LoadRun(arguments.run, common.device);
  const fs::path scene_path = arguments.scene.empty() ? fs::path(run.scene_path) : arguments.scene;
  if (!fs::exists(scene_path)) {
    Throw<DataError>("{}: no such scene; the run in {} was trained on it: give its new place with --scene",
                     scene_path.string(), arguments.run.string());
  }
  const Scene scene = OpenScene(scene_path, common.Over(run.config).data);
  EvaluationRequest request;
  request.protocols = Chosen(run, scene, arguments.protocol);
  request.pictures = arguments.pictures;
  request.max_frames = arguments.max_frames;
  request.detection_folder = arguments.key_points.empty() ? scene_path : arguments.key_points;
  if (!arguments.lpips_backbone.empty()) {
    request.lpips = LoadLpips(arguments.lpips_backbone, arguments.lpips_linear);
    request.lpips->to(common.device);
  }
  EvaluationResult result = EvaluateRun(run, scene, request);
  AddStageSeconds(arguments.run, &result);
  Json json = ToJson(result);
  const Json key_points = ToJson(MeasureKeyPoints(run, scene, request.detection_folder));
  json.update(key_points);
  WriteJson(arguments.json, json);
  LogTable(result);
  for (const auto& item : key_points.items()) LogInfo("{}: {}", item.key(), item.value().dump());
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  return RunProgram(
      "enf-eval", "Measures a run against its scene.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("RUN", arguments.run, "run folder of enf-train or enf-pretrain")->required();
        app.add_option("--protocol", arguments.protocol, "reconstruction, interpolation, editing, or all that can be")
            ->check(CLI::IsMember({"reconstruction", "interpolation", "editing", "all"}).description(""))
            ->capture_default_str();
        app.add_option("--json", arguments.json, "file for the scores")->required();
        app.add_option("--scene", arguments.scene, "the run's scene, where it has moved");
        app.add_option("--key-points", arguments.key_points,
                       "folder of enf-detect-keypoints --out; the scene by default");
        auto* backbone = app.add_option("--lpips-backbone", arguments.lpips_backbone, "weights of SqueezeNet 1.1");
        auto* linear = app.add_option("--lpips-linear", arguments.lpips_linear, "weights of LPIPS v0.1 for it");
        backbone->needs(linear);
        linear->needs(backbone);
        app.add_option("--pictures", arguments.pictures, "folder for pictures, truth on the left");
        app.add_option("--max-frames", arguments.max_frames, "of each protocol, evenly spaced; 0 for all")
            ->check(CLI::NonNegativeNumber);
      },
      [&](const CommonOptions& common) { Evaluate(arguments, common); });
}
