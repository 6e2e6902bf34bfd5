#include "libeditnerf/benchmarks/bench_scene.h"

#include <fmt/ranges.h>
#include <torch/nn/module.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <filesystem>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/pipeline/stages.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

// One point on each part's true path.
torch::Tensor TrueTracks(const Scene& scene) {
  const torch::Tensor train = torch::tensor(scene.train, torch::kInt64);
  return scene.truth->scene_from_object.index_select(0, train)
      .slice(2, 0, 3)
      .select(3, 3)
      .to(torch::kFloat32)
      .contiguous();
}

}  // namespace

BenchScene OpenBenchScene(const std::string& source, const SyntheticOptions& options, const DataConfig& config) {
  const std::vector<std::string> names = SyntheticSceneNames();
  BenchScene bench;
  bench.source = source;
  if (std::find(names.begin(), names.end(), source) != names.end()) {
    bench.scene = MakeSyntheticScene(source, options);
  } else if (fs::exists(source)) {
    bench.scene = OpenScene(source, config);
    if (fs::is_directory(source) && HasKeyPointFiles(source)) {
      bench.tracks = ReadKeyPointFiles(source).InSceneUnits().to(torch::kFloat32);
    }
  } else {
    Throw<DataError>("{}: no such scene; expected a scene folder, a packed scene, or one of {}", source,
                     fmt::join(names, ", "));
  }
  if (!bench.tracks.defined() && bench.scene.truth && !bench.scene.truth->objects.empty()) {
    bench.tracks = TrueTracks(bench.scene);
  }
  if (!bench.tracks.defined()) bench.tracks = torch::zeros({static_cast<int64_t>(bench.scene.train.size()), 0, 3});
  return bench;
}

Run MakeBenchRun(const Config& config, FieldStage stage, const BenchScene& bench, torch::Device device) {
  Run run = MakeRun(config, stage, bench.scene, stage == FieldStage::kTrain ? bench.tracks : torch::Tensor(), device);
  run.scene_path = bench.source;
  return run;
}

Run CopyRun(const Run& run, const Config& config, const BenchScene& bench) {
  Run copy = MakeBenchRun(config, run.stage, bench, run.device);
  const torch::NoGradGuard no_grad;
  const auto copy_tensors = [](const torch::nn::Module& from, const torch::nn::Module& to) {
    const auto parameters = from.named_parameters();
    for (const auto& item : to.named_parameters()) item.value().copy_(parameters[item.key()]);
    const auto buffers = from.named_buffers();
    for (const auto& item : to.named_buffers()) item.value().copy_(buffers[item.key()]);
  };
  copy_tensors(*run.field, *copy.field);
  copy_tensors(*run.renderer, *copy.renderer);
  copy.counters = run.counters;
  return copy;
}

Run TrainBriefly(const Run& run, const Scene& scene, int64_t steps, double seconds) {
  Trainer trainer(run, scene, std::nullopt, fs::path());
  Progress bar("training", static_cast<double>(steps));
  const Stopwatch watch;
  for (int64_t step = 0; step < steps && (seconds == 0 || watch.Seconds() < seconds); ++step) {
    if (InterruptRequested()) Throw<Interrupted>("benchmark stopped by request");
    trainer.Step();
    bar.Update(static_cast<double>(step + 1));
  }
  bar.Finish();
  return trainer.run();
}

}  // namespace editnerf
