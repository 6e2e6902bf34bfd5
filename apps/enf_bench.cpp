// enf-bench kernels|train|growth|render|diagram|tables|stability: what this machine makes of the library.
#include <cstdio>
#include <filesystem>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/machine.h"
#include "libeditnerf/benchmarks/diagram_benchmark.h"
#include "libeditnerf/benchmarks/kernel_benchmark.h"
#include "libeditnerf/benchmarks/render_benchmark.h"
#include "libeditnerf/benchmarks/stability_benchmark.h"
#include "libeditnerf/benchmarks/tables_benchmark.h"
#include "libeditnerf/benchmarks/train_benchmark.h"
#include "support/config_files.h"
#include "support/run.h"

namespace {

using namespace editnerf;
namespace fs = std::filesystem;

struct Arguments {
  fs::path json;
  std::string scene, stage = "train";
  SyntheticOptions synthetic;
  KernelBenchmark kernels;
  TrainBenchmark train;
  GrowthBenchmark growth;
  RenderBenchmark render;
  double render_seconds = 20;
  DiagramBenchmark diagram;
  StabilityBenchmark stability;
  TablesBenchmark tables;
  fs::path lpips_backbone, lpips_linear;
  std::vector<std::string> variants;
};

void AddSizeOptions(CLI::App* command, Arguments* a) {
  command->add_option("--frames", a->synthetic.frames, "training frames of a synthetic scene")->capture_default_str();
  command->add_option("--width", a->synthetic.width, "pixels of a synthetic scene")->capture_default_str();
  command->add_option("--height", a->synthetic.height, "pixels of a synthetic scene")->capture_default_str();
}

void AddSceneOptions(CLI::App* command, Arguments* a, const char* what) {
  command->add_option("SCENE", a->scene, what)->required();
  AddSizeOptions(command, a);
}

void AddKernels(CLI::App& app, Arguments* a) {
  auto* command = app.add_subcommand("kernels", "every kernel beside LibTorch's operations");
  command->add_option("--samples", a->kernels.samples, "of a call")->check(CLI::Range(1024, 1 << 20));
  command->add_option("--repeats", a->kernels.repeats, "medians are over these")->check(CLI::Range(1, 1000));
  command->add_option("--least-seconds", a->kernels.least_seconds, "of a repeat")->check(CLI::Range(1e-4, 10.0));
}

void AddStability(CLI::App& app, Arguments* a) {
  auto* command = app.add_subcommand("stability", "largest errors of every operator where careless formulations fail");
  command->add_option("--repeats", a->stability.repeats, "medians are over these")->check(CLI::Range(1, 1000));
  command->add_option("--least-seconds", a->stability.least_seconds, "of a repeat")->check(CLI::Range(1e-4, 10.0));
}

void AddTrain(CLI::App& app, Arguments* a) {
  auto* command = app.add_subcommand("train", "training steps: samples a second, and where the time goes");
  AddSceneOptions(command, a, "scene folder, packed scene, or name of a synthetic scene");
  command->add_option("--stage", a->stage, "train or pretrain")->check(CLI::IsMember({"train", "pretrain"}));
  command->add_option("--warm-up", a->train.warm_up, "steps before the measurement")->check(CLI::Range(1, 1 << 20));
  command->add_option("--steps", a->train.steps, "of a measurement")->check(CLI::Range(1, 1 << 20));
  command->add_option("--repeats", a->train.repeats, "measurements")->check(CLI::Range(1, 1000));
  auto* growth = app.add_subcommand("growth", "time of a step against its samples and the number of frames");
  growth->add_option("--scene", a->growth.scene, "synthetic scene")->check(CLI::IsMember(SyntheticSceneNames()));
  growth->add_option("--samples", a->growth.samples, "of a step, several");
  growth->add_option("--frames", a->growth.frames, "of a scene, several");
  growth->add_option("--warm-up", a->growth.warm_up, "steps before the measurement")->check(CLI::Range(1, 1 << 20));
  growth->add_option("--steps", a->growth.steps, "of a measurement")->check(CLI::Range(1, 1 << 20));
}

void AddRender(CLI::App& app, Arguments* a) {
  auto* command = app.add_subcommand("render", "pictures a second");
  AddSceneOptions(command, a, "run folder; or a scene as for train, to be trained first");
  command->add_option("--seconds", a->render_seconds, "of training, where a scene is given")
      ->check(CLI::PositiveNumber);
  command->add_option("--pictures", a->render.frames, "of each size")->check(CLI::Range(1, 1000));
  auto* diagram = app.add_subcommand("diagram", "error against run time of several configurations");
  AddSceneOptions(diagram, a, "scene folder, packed scene, or name of a synthetic scene");
  diagram->add_option("--out", a->diagram.folder, "folder for the runs and diagram.svg")->required();
  diagram->add_option("--seconds", a->diagram.seconds, "of training, for each")->check(CLI::PositiveNumber);
  diagram->add_option("--measurements", a->diagram.measurements, "of the error")->check(CLI::Range(1, 1000));
  diagram
      ->add_option("--variants", a->variants,
                   "some of fast, warp, appearance, no-direction, no-local, fp32, modules, paper")
      ->delimiter(',');
}

void AddTables(CLI::App& app, Arguments* a) {
  auto* command = app.add_subcommand("tables", "the paper's tables: fields, ablation, depth, key points, flow");
  command->add_option("SCENES", a->tables.scenes, "scene folders, packed scenes, or names of synthetic scenes")
      ->required();
  AddSizeOptions(command, a);
  command->add_option("--out", a->tables.folder, "folder for the runs; repeat the call to go on")->required();
  command->add_option("--seeds", a->tables.seeds, "several, e.g. 1,2,3")->delimiter(',')->capture_default_str();
  command->add_option("--paper-seconds", a->tables.paper_seconds, "of training the paper's networks; 0 leaves them out")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("!--no-ladder", a->tables.ladder, "without the ablation");
  command->add_option("--max-frames", a->tables.max_frames, "measured of each protocol; 0 for all")
      ->check(CLI::NonNegativeNumber);
  auto* backbone = command->add_option("--lpips-backbone", a->lpips_backbone, "weights of SqueezeNet 1.1");
  auto* linear = command->add_option("--lpips-linear", a->lpips_linear, "weights of LPIPS v0.1 for it");
  backbone->needs(linear);
  linear->needs(backbone);
}

BenchmarkResult RunTables(Arguments a, const CommonOptions& common) {
  a.tables.synthetic = a.synthetic;
  a.tables.paper = LoadNamedConfig("paper");
  a.tables.device = common.device;
  if (!a.lpips_backbone.empty()) {
    a.tables.lpips = LoadLpips(a.lpips_backbone, a.lpips_linear);
    a.tables.lpips->to(common.device);
  }
  return RunTablesBenchmark(common.config, a.tables);
}

std::vector<DiagramVariant> ChosenVariants(const Config& config, const std::vector<std::string>& names) {
  std::vector<DiagramVariant> all = DiagramVariants(config, LoadNamedConfig("paper"));
  if (names.empty()) return all;
  std::vector<DiagramVariant> chosen;
  for (const std::string& name : names) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const auto& variant) { return variant.name == name; });
    if (found == all.end()) Throw<ConfigError>("--variants: unknown configuration '{}'; see --help", name);
    chosen.push_back(*found);
  }
  return chosen;
}

Run OpenOrTrain(const Arguments& a, const CommonOptions& common) {
  if (fs::exists(fs::path(a.scene) / "checkpoint.safetensors")) return LoadRun(a.scene, common.device);
  const BenchScene bench = OpenBenchScene(a.scene, a.synthetic, common.config.data);
  constexpr int64_t kMostSteps = 1'000'000;
  return TrainBriefly(MakeBenchRun(common.config, FieldStage::kTrain, bench, common.device), bench.scene, kMostSteps,
                      a.render_seconds);
}

BenchmarkResult RunCommand(const std::string& name, Arguments a, const CommonOptions& common) {
  if (name == "kernels") return RunKernelBenchmark(common.config, a.kernels);
  if (name == "stability") return RunStabilityBenchmark(a.stability);
  if (name == "tables") return RunTables(a, common);
  if (name == "growth") return RunGrowthBenchmark(common.config, a.growth);
  if (name == "render") return RunRenderBenchmark(OpenOrTrain(a, common), a.render);
  const BenchScene bench = OpenBenchScene(a.scene, a.synthetic, common.config.data);
  if (name == "train") {
    a.train.stage = a.stage == "train" ? FieldStage::kTrain : FieldStage::kPretrain;
    a.train.device = common.device;
    return RunTrainBenchmark(bench, common.config, a.train);
  }
  a.diagram.seed = static_cast<uint64_t>(common.seed);
  a.diagram.device = common.device;
  return RunDiagramBenchmark(bench, ChosenVariants(common.config, a.variants), a.diagram);
}

void Report(const std::string& name, BenchmarkResult result, const fs::path& json) {
  for (const BenchmarkTable& table : result.tables) std::printf("%s\n", ToText(table).c_str());
  result.json["benchmark"] = name;
  result.json["machine"] = MachineJson();
  result.json["peak_resident_bytes"] = PeakResidentBytes();
  if (!json.empty()) WriteJson(json, result.json);
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App* parsed = nullptr;
  return RunProgram(
      "enf-bench", "Measures the library on this machine.", argc, argv,
      [&](CLI::App& app) {
        parsed = &app;
        arguments.synthetic.frames = 60;
        arguments.synthetic.val_frames = arguments.synthetic.edit_frames = 8;
        arguments.synthetic.samples_per_side = 2;
        app.fallthrough();
        app.require_subcommand(1);
        app.add_option("--json", arguments.json, "file for everything that was measured");
        AddKernels(app, &arguments);
        AddTrain(app, &arguments);
        AddRender(app, &arguments);
        AddTables(app, &arguments);
        AddStability(app, &arguments);
      },
      [&](const CommonOptions& common) {
        const std::string name = parsed->get_subcommands().front()->get_name();
        const BenchmarkResult result = RunCommand(name, arguments, common);
        Report(name, result, arguments.json);
        if (const int64_t failed = result.json.value("failed", int64_t{0}); failed > 0) {
          Throw<Error>("stability: {} of {} rows are not within their bounds: those that end with FAIL", failed,
                       result.json.at("rows").size());
        }
      });
}
