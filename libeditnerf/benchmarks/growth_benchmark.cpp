#include <fmt/format.h>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/machine.h"
#include "libeditnerf/benchmarks/timing.h"
#include "libeditnerf/benchmarks/train_benchmark.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {
namespace {

BenchScene SceneOf(const GrowthBenchmark& options, int64_t frames) {
  SyntheticOptions scene;
  scene.frames = frames;
  scene.val_frames = 1;
  scene.edit_frames = 0;
  scene.width = options.width;
  scene.height = options.height;
  scene.samples_per_side = 1;
  return OpenBenchScene(options.scene, scene, {});
}

struct Point {
  double step_seconds, processor_seconds, samples;
};

// Medians over single steps.
Point MeasureSteps(const Run& run, const Scene& scene, const GrowthBenchmark& options) {
  Trainer trainer(TrainBriefly(run, scene, options.warm_up, 0), scene, std::nullopt, {});
  trainer.Step();
  std::vector<double> seconds, processor, samples;
  for (int64_t i = 0; i < options.steps; ++i) {
    const int64_t samples_before = trainer.run().counters.samples;
    const double before = ProcessorSeconds();
    const Stopwatch watch;
    trainer.Step();
    seconds.push_back(watch.Seconds());
    processor.push_back(ProcessorSeconds() - before);
    samples.push_back(static_cast<double>(trainer.run().counters.samples - samples_before));
  }
  return {Median(seconds), Median(processor), Median(samples)};
}

Json ToJson(const Point& point) {
  return {
      {"step_seconds", point.step_seconds}, {"processor_seconds", point.processor_seconds}, {"samples", point.samples}};
}

std::vector<std::string> Row(int64_t size, const Point& point) {
  return {std::to_string(size), fmt::format("{:.0f}", point.samples), fmt::format("{:.1f}", 1e3 * point.step_seconds),
          fmt::format("{:.1f}", 1e3 * point.processor_seconds),
          fmt::format("{:.0f}", 1e9 * point.processor_seconds / point.samples)};
}

}  // namespace

BenchmarkResult RunGrowthBenchmark(const Config& config, const GrowthBenchmark& options) {
  const std::vector<std::string> columns = {"", "samples", "ms/step", "processor ms/step", "processor ns/sample"};
  BenchmarkTable by_samples{"a step against its samples (samples_per_step)", columns, {}};
  BenchmarkTable by_frames{"a step against the number of frames", columns, {}};
  BenchmarkResult result;
  result.json["samples"] = Json::array();
  result.json["frames"] = Json::array();
  const BenchScene few = SceneOf(options, options.frames.front());
  for (const int64_t samples : options.samples) {
    Config own = config;
    own.train.samples_per_step = samples;
    own.train.rays_per_step = samples;
    const Point point = MeasureSteps(MakeBenchRun(own, FieldStage::kTrain, few, torch::kCPU), few.scene, options);
    by_samples.rows.push_back(Row(samples, point));
    result.json["samples"].push_back(ToJson(point));
    result.json["samples"].back()["samples_per_step"] = samples;
  }
  for (const int64_t frames : options.frames) {
    const BenchScene bench = SceneOf(options, frames);
    const Point point =
        MeasureSteps(MakeBenchRun(config, FieldStage::kTrain, bench, torch::kCPU), bench.scene, options);
    by_frames.rows.push_back(Row(frames, point));
    result.json["frames"].push_back(ToJson(point));
    result.json["frames"].back()["frames"] = frames;
  }
  result.tables = {by_samples, by_frames};
  return result;
}

}  // namespace editnerf
