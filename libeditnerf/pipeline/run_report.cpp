#include "libeditnerf/pipeline/run_report.h"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "libeditnerf/base/file.h"
#include "libeditnerf/base/machine.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/evaluation/report.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/pipeline/demo_edit.h"
#include "libeditnerf/pipeline/evaluate_run.h"
#include "libeditnerf/pipeline/key_point_scores.h"
#include "libeditnerf/pipeline/rendering.h"
#include "libeditnerf/render/image_renderer.h"
#include "libeditnerf/training/metrics_log.h"
#include "libeditnerf/training/run.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kFramesPerProtocol = 6;  // the report measures a sample; enf-eval measures all
constexpr int64_t kDemoSweepFrames = 16;

nlohmann::ordered_json ReadIfThere(const fs::path& path) {
  return fs::exists(path) ? nlohmann::ordered_json(ReadJson(path)) : nlohmann::ordered_json::object();
}

ChartSeries HeldOutSeries(const std::string& name, const fs::path& csv) {
  ChartSeries series{name, {}, false};
  if (!fs::exists(csv)) return series;
  for (const MetricsRow& row : ReadMetricsLog(csv)) {
    if (row.held_out_psnr) series.points.emplace_back(row.seconds_training, *row.held_out_psnr);
  }
  return series;
}

ChartSeries LossSeries(const std::string& name, const fs::path& csv) {
  ChartSeries series{name, {}, false};
  if (!fs::exists(csv)) return series;
  for (const MetricsRow& row : ReadMetricsLog(csv)) {
    const auto found = row.losses.find("reconstruction");
    if (found != row.losses.end() && found->second > 0) {
      series.points.emplace_back(row.seconds_training, -10 * std::log10(found->second));
    }
  }
  return series;
}

void AddCharts(const fs::path& work, ReportContents* report) {
  LineChart held_out;
  held_out.title = "Held-out error against training time";
  held_out.x_label = "seconds of training";
  held_out.y_label = "PSNR, dB";
  held_out.series = {HeldOutSeries("pretraining", work / "pretrained" / "metrics.csv"),
                     HeldOutSeries("editable field", work / "run" / "metrics.csv")};
  LineChart training = held_out;
  training.title = "Error on the training rays against training time";
  training.series = {LossSeries("pretraining", work / "pretrained" / "metrics.csv"),
                     LossSeries("editable field", work / "run" / "metrics.csv")};
  for (const LineChart& chart : {held_out, training}) {
    const auto has_points = [](const ChartSeries& series) { return !series.points.empty(); };
    if (std::any_of(chart.series.begin(), chart.series.end(), has_points)) report->charts.push_back(chart);
  }
}

void AddPicture(const fs::path& path, const std::string& caption, bool is_wide, ReportContents* report) {
  if (fs::exists(path)) report->pictures.push_back({caption, ReadFile(path), is_wide});
}

// Photograph, picture, depth and weights of a few training frames, one row each.
torch::Tensor MakeStrip(const Run& run, const Scene& scene) {
  const torch::NoGradGuard no_grad;
  const auto count = static_cast<int64_t>(scene.train.size());
  std::vector<torch::Tensor> rows;
  for (const double share : {0.1, 0.5, 0.9}) {
    const int64_t row = std::clamp<int64_t>(std::llround(share * static_cast<double>(count - 1)), 0, count - 1);
    const int64_t frame = scene.train[static_cast<size_t>(row)];
    ImageOptions options;
    options.tensor = torch::TensorOptions(torch::kFloat32).device(run.device);
    const RenderedImage image =
        RenderImage(*run.field, *run.renderer, scene.frames[static_cast<size_t>(frame)].camera,
                    run.field->States(torch::tensor({row}, torch::kInt64).to(run.device)), options);
    std::vector<torch::Tensor> pictures = {
        scene.images[frame], ToBytes(image.rgb),
        DepthPicture(image.depth.to(torch::kCPU), scene.transform.near, scene.transform.far)};
    if (run.field->num_key_points() > 0) {
      const torch::Tensor weights = image.weights.defined() ? image.weights.to(torch::kCPU) : image.weights;
      pictures.push_back(WeightPicture(weights, image.rgb.to(torch::kCPU), image.depth_valid.to(torch::kCPU)));
    }
    rows.push_back(torch::cat(pictures, 1));
  }
  return torch::cat(rows, 0).contiguous();
}

std::string Number(const nlohmann::ordered_json& scores, const std::string& key, const char* format) {
  const auto found = scores.find(key);
  return found != scores.end() && found->is_number() ? fmt::format(fmt::runtime(format), found->get<double>()) : "-";
}

void AddScores(const nlohmann::ordered_json& scores, ReportContents* report) {
  ReportTable table;
  table.title = "Scores";
  table.headers = {"protocol", "frames", "PSNR, dB", "PSNR of moving pixels, dB", "SSIM", "MS-SSIM"};
  for (const auto& [protocol, title] : std::vector<std::pair<std::string, std::string>>{
           {"reconstruction", "reconstruction: known states, new views"},
           {"interpolation", "interpolation: held-out times"},
           {"editing", "editing: states never seen"},
           {"editing_nearest", "editing, baseline: the nearest training frame's image"},
           {"reconstruction_nearest", "reconstruction, baseline: the image of that state"}}) {
    if (!scores.contains(protocol + ".psnr")) continue;
    table.rows.push_back(
        {title, Number(scores, protocol + ".frames", "{:.0f}"), Number(scores, protocol + ".psnr", "{:.2f}"),
         Number(scores, protocol + ".psnr_moving", "{:.2f}"), Number(scores, protocol + ".ssim", "{:.4f}"),
         Number(scores, protocol + ".ms_ssim", "{:.4f}")});
  }
  if (!table.rows.empty()) report->tables.push_back(table);
  for (const auto& [key, title] :
       std::vector<std::pair<std::string, std::string>>{{"reconstruction.psnr", "PSNR, new views"},
                                                        {"interpolation.psnr", "PSNR, held-out times"},
                                                        {"editing.psnr", "PSNR, unseen edits"}}) {
    if (scores.contains(key)) report->facts.emplace_back(title, Number(scores, key, "{:.2f} dB"));
  }
}

void AddStages(const fs::path& work, ReportContents* report) {
  const nlohmann::ordered_json stages = ReadIfThere(work / "stages.json");
  double total = 0;
  for (const char* name : {"scene", "pretrain", "detect", "train"}) {
    const auto seconds = stages.find(name);
    if (seconds == stages.end() || !seconds->is_number()) continue;
    report->stages.push_back({name, seconds->get<double>(), "done"});
    total += seconds->get<double>();
  }
  report->facts.emplace_back("time before this report", SpokenDuration(total));
}

void AddComponents(const fs::path& work, ReportContents* report) {
  ReportTable table;
  table.title = "What this scene needs of the field";
  table.headers = {"component", "decided", "held out without, dB", "with, dB", "why"};
  for (const char* folder : {"pretrained", "run"}) {
    const nlohmann::ordered_json components = ReadIfThere(work / folder / "components.json");
    for (const auto& [setting, trial] : components.items()) {
      table.rows.push_back({setting, trial.value("on", false) ? "on" : "off", Number(trial, "without", "{:.2f}"),
                            Number(trial, "with", "{:.2f}"), trial.value("reason", "")});
    }
  }
  if (!table.rows.empty()) report->tables.push_back(table);
}

void AddSkippedSteps(const fs::path& work, ReportContents* report) {
  for (const auto& [folder, stage] : {std::pair{"pretrained", "pretraining"}, std::pair{"run", "training"}}) {
    if (!fs::exists(work / folder / "checkpoint.safetensors")) continue;
    const RunCounters counters = LoadCounters(work / folder);
    if (counters.skipped > 0) report->notes.push_back({true, fmt::format("{}: {}", stage, SkippedText(counters))});
  }
}

void AddDetectionNotes(const fs::path& work, ReportContents* report) {
  const nlohmann::ordered_json detection = ReadIfThere(work / "scene" / "data" / "detection.json");
  const auto notes = detection.find("notes");
  if (notes == detection.end() || !notes->is_array()) return;
  int dropped = 0;
  for (const auto& note : *notes) {
    if (!note.is_string()) continue;
    const auto text = note.get<std::string>();
    if (text.find(" dropped: ") != std::string::npos) {
      ++dropped;
    } else {
      report->notes.push_back({false, "detection: " + text});
    }
  }
  if (dropped == 0) return;
  report->notes.push_back(
      {false, fmt::format("detection: {} other candidates were dropped; scene/data/detection.json says why", dropped)});
}

std::string Machine() {
  utsname name{};
  return fmt::format("{}{}, {} threads", ProcessorName(), uname(&name) == 0 ? fmt::format(", {}", name.machine) : "",
                     NumThreads());
}

}  // namespace

void WriteRunReport(const fs::path& work, const Scene& scene, torch::Device device, const std::string& command) {
  const fs::path out = work / "report";
  MakeFolder(out);
  Run run = LoadRun(work / "run", device);

  EvaluationRequest request;
  for (const std::string& protocol : EvaluationProtocols()) {
    if (ReasonAgainst(run, scene, protocol).empty()) request.protocols.insert(protocol);
  }
  request.max_frames = kFramesPerProtocol;
  request.detection_folder = work / "scene";
  request.pictures = out / "pictures";
  nlohmann::ordered_json scores = ToJson(EvaluateRun(run, scene, request));
  scores.update(ToJson(MeasureKeyPoints(run, scene, request.detection_folder)));
  WriteJson(out / "scores.json", scores);

  const EditFile edit = MakeDemoEdit(run, kDemoSweepFrames);
  WriteFileAtomically(out / "edit.json", WriteEditFile(edit));
  RenderOutput video;
  video.path = out / "edited.mp4";
  RenderFrames(run, PlanEdit(run, edit), video);
  WritePng(out / "strip.png", MakeStrip(run, scene));

  ReportContents report;
  report.title = "Editable scene: " + scene.name;
  report.subtitle = fmt::format("{} training frames, {} x {} pixels, {}", scene.train.size(), scene.width(),
                                scene.height(), Machine());
  report.facts.emplace_back("key points", std::to_string(run.field->num_key_points()));
  AddScores(scores, &report);
  AddComponents(work, &report);
  AddStages(work, &report);
  AddSkippedSteps(work, &report);
  AddDetectionNotes(work, &report);
  report.notes.push_back({false, "made by: " + command});
  report.videos.push_back({"An edit that nobody filmed: each key point swept through its range", "", "edited.mp4"});
  AddPicture(out / "strip.png", "Photograph, picture, depth, and which key point governs what", true, &report);
  AddPicture(work / "scene" / "data" / "tracks.png", "Key points and their tracks", true, &report);
  AddPicture(work / "scene" / "data" / "motion.png", "What moves (red) and what does not (blue), by optical flow", true,
             &report);
  AddPicture(work / "scene" / "data" / "variance.png", "Where the ambient coordinates vary: three projections", true,
             &report);
  AddCharts(work, &report);
  WriteFileAtomically(out / "index.html", ToHtml(report));
}

}  // namespace editnerf
