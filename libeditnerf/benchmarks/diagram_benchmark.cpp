#include "libeditnerf/benchmarks/diagram_benchmark.h"

#include <fmt/format.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/evaluation/line_chart.h"
#include "libeditnerf/pipeline/evaluate_run.h"
#include "libeditnerf/training/metrics_log.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {
namespace {

constexpr double kThresholds[] = {25, 30, 35, 40};  // dB
constexpr int64_t kProbeSteps = 3;                  // that say how long a step takes
constexpr int64_t kEditFrames = 4;
constexpr double kSlowStep = 1, kSlowShare = 0.5;  // seconds; of the measurements, where a step takes longer

double SecondsOfStep(const Config& config, const BenchScene& bench, torch::Device device) {
  Trainer trainer(MakeBenchRun(config, FieldStage::kTrain, bench, device), bench.scene, std::nullopt, {});
  trainer.Step();
  const Stopwatch watch;
  for (int64_t i = 0; i < kProbeSteps; ++i) trainer.Step();
  return watch.Seconds() / kProbeSteps;
}

std::optional<double> SecondsTo(const std::vector<MetricsRow>& rows, double psnr) {
  for (const MetricsRow& row : rows) {
    if (row.held_out_psnr && *row.held_out_psnr >= psnr) return row.seconds_training;
  }
  return std::nullopt;
}

std::optional<double> EditingPsnr(Run& run, const Scene& scene) {
  if (!ReasonAgainst(run, scene, "editing").empty()) return std::nullopt;
  EvaluationRequest request;
  request.protocols = {"editing"};
  request.max_frames = kEditFrames;
  const Json scores = ToJson(EvaluateRun(run, scene, request));
  const auto found = scores.find("editing.psnr");
  if (found == scores.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

std::string Cell(const std::optional<double>& value, const char* format) {
  return value ? fmt::format(fmt::runtime(format), *value) : "-";
}

Json Value(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

// Trains one variant and adds its line, row and JSON.
void AddVariant(const BenchScene& bench, const DiagramVariant& variant, const DiagramBenchmark& options,
                LineChart* chart, BenchmarkResult* result) {
  LogInfo("{}: {}", variant.name, variant.description);
  Config config = variant.config;
  const double step = SecondsOfStep(config, bench, options.device);
  const double wanted = static_cast<double>(options.measurements) * (step > kSlowStep ? kSlowShare : 1);
  config.train.seconds = options.seconds;
  config.train.evaluate_every = std::max<int64_t>(1, std::llround(options.seconds / step / wanted));
  config.train.log_every = config.train.evaluate_every;
  config.train.checkpoint_every = 1'000'000'000;
  torch::manual_seed(options.seed);
  Trainer trainer(MakeBenchRun(config, FieldStage::kTrain, bench, options.device), bench.scene, std::nullopt,
                  options.folder / variant.name);
  trainer.Train();
  const std::vector<MetricsRow> rows = ReadMetricsLog(options.folder / variant.name / "metrics.csv");
  ChartSeries line{variant.name, {}, false};
  Json json = {{"name", variant.name}, {"description", variant.description}, {"points", Json::array()}};
  std::optional<double> last;
  for (const MetricsRow& row : rows) {
    if (!row.held_out_psnr) continue;
    last = row.held_out_psnr;
    line.points.emplace_back(row.seconds_training, *last);
    json["points"].push_back(
        {{"seconds", row.seconds_training}, {"step", row.step}, {"samples", row.samples}, {"psnr", *last}});
  }
  chart->series.push_back(line);
  Run run = trainer.run();
  // Pictures of a field whose steps take seconds would take minutes each.
  const std::optional<double> editing = step > kSlowStep ? std::nullopt : EditingPsnr(run, bench.scene);
  std::vector<std::string> cells = {variant.name, std::to_string(run.counters.step)};
  for (const double threshold : kThresholds) {
    const std::optional<double> seconds = SecondsTo(rows, threshold);
    json["seconds_to"][fmt::format("{:.0f}", threshold)] = Value(seconds);
    cells.push_back(Cell(seconds, "{:.1f} s"));
  }
  json["psnr"] = Value(last);
  json["editing_psnr"] = Value(editing);
  json["steps"] = run.counters.step;
  cells.push_back(Cell(last, "{:.2f} dB"));
  cells.push_back(Cell(editing, "{:.2f} dB"));
  result->tables.front().rows.push_back(cells);
  result->json["variants"].push_back(json);
}

}  // namespace

std::vector<DiagramVariant> DiagramVariants(const Config& fast, const Config& paper) {
  std::vector<DiagramVariant> variants;
  const auto add = [&](const char* name, const char* description, const std::vector<std::string>& changes) {
    Config config = fast;
    for (const std::string& change : changes) ApplyOverride(config, change, name);
    variants.push_back({name, description, config});
  };
  add("fast", "as configured", {});
  add("warp", "with a warp field, and so module by module", {"field.warp.enabled=true"});
  add("appearance", "with appearance codes", {"field.use_appearance=true"});
  add("no-direction", "without the view direction", {"field.use_view_direction=false"});
  // A hash grid of a hundredth of the scene around the key point is none.
  add("no-local", "without the hash grid in the key points' frame", {"field.fast.local_extent=0.01"});
  add("no-shade", "without the hash grid of what parts cast on others", {"field.fast.shade=false"});
  add("all-gradients", "every gradient, none by lot", {"train.roulette=0"});
  add("fp32", "with all products and tables in float32", {"field.fast.kernel=fp32"});
  add("modules", "module by module", {"field.fast.kernel=modules"});
  Config batches = paper;
  batches.train.rays_per_step = std::min(batches.train.rays_per_step, kPaperRays);
  variants.push_back(
      {"paper", fmt::format("the paper's networks, {} rays a step", batches.train.rays_per_step), batches});
  return variants;
}

BenchmarkResult RunDiagramBenchmark(const BenchScene& bench, const std::vector<DiagramVariant>& variants,
                                    const DiagramBenchmark& options) {
  MakeFolder(options.folder);
  BenchmarkResult result;
  BenchmarkTable table;
  table.title = fmt::format("{}, {:.0f} s of training each: seconds to a held-out PSNR, and PSNR at the end",
                            bench.source, options.seconds);
  table.headers = {"", "steps", "25 dB", "30 dB", "35 dB", "40 dB", "held out", "edits"};
  result.tables.push_back(table);
  result.json = {{"scene", bench.source}, {"seconds", options.seconds}, {"variants", Json::array()}};
  LineChart chart;
  chart.title = fmt::format("{}: held-out error against training time", bench.scene.name);
  chart.x_label = "seconds of training";
  chart.y_label = "PSNR, dB";
  chart.log_x = true;
  for (const DiagramVariant& variant : variants) AddVariant(bench, variant, options, &chart, &result);
  const std::filesystem::path picture = options.folder / "diagram.svg";
  WriteFileAtomically(picture, ToSvg(chart));
  result.json["diagram"] = picture.string();
  return result;
}

}  // namespace editnerf
