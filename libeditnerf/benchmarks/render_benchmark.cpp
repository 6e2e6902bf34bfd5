#include "libeditnerf/benchmarks/render_benchmark.h"

#include <fmt/format.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/machine.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/benchmarks/bench_scene.h"
#include "libeditnerf/benchmarks/timing.h"
#include "libeditnerf/render/image_renderer.h"

namespace editnerf {
namespace {

struct PictureCosts {
  double milliseconds = 0, processor = 0, samples_per_pixel = 0;
};

// Medians over training views.
PictureCosts Measure(const Run& run, int64_t width, int64_t height, int64_t frames) {
  const torch::NoGradGuard no_grad;
  const auto count = static_cast<int64_t>(run.scene.train.size());
  std::vector<double> seconds, processor, samples;
  for (int64_t i = -1; i < frames; ++i) {  // the first warms up
    const int64_t row = std::max<int64_t>(i, 0) * (count - 1) / std::max<int64_t>(frames - 1, 1);
    const Camera camera =
        run.scene.frames[static_cast<size_t>(run.scene.train[static_cast<size_t>(row)])].camera.Resized(width, height);
    const FrameStates states = run.field->States(torch::tensor({row}, torch::kInt64).to(run.device));
    ImageOptions options;
    options.tensor = torch::TensorOptions(torch::kFloat32).device(run.device);
    const double before = ProcessorSeconds();
    const Stopwatch watch;
    const RenderedImage image = RenderImage(*run.field, *run.renderer, camera, states, options);
    const double passed = watch.Seconds();
    if (i < 0) continue;
    seconds.push_back(passed);
    processor.push_back(ProcessorSeconds() - before);
    samples.push_back(static_cast<double>(image.samples) / static_cast<double>(width * height));
  }
  return {1e3 * Median(seconds), 1e3 * Median(processor), Median(samples)};
}

Run WithKernel(const Run& run, const char* kernel) {
  Config config = run.config;
  config.field.fast.kernel = kernel;
  BenchScene bench;
  bench.scene = run.scene;
  const torch::NoGradGuard no_grad;
  bench.tracks =
      run.field->States(torch::arange(static_cast<int64_t>(run.scene.train.size())).to(run.device)).key_points;
  if (!bench.tracks.defined()) bench.tracks = torch::zeros({0, 0, 3});
  return CopyRun(run, config, bench);
}

}  // namespace

BenchmarkResult RunRenderBenchmark(const Run& run, const RenderBenchmark& options) {
  run.field->eval();
  BenchmarkResult result;
  BenchmarkTable table{"pictures", {"", "frames/s", "ms", "processor ms", "colours/pixel"}, {}};
  Json pictures = Json::array();
  const auto add = [&](const std::string& name, int64_t width, int64_t height, const PictureCosts& costs) {
    pictures.push_back({{"name", name},
                        {"width", width},
                        {"height", height},
                        {"frames_per_second", 1e3 / costs.milliseconds},
                        {"milliseconds", costs.milliseconds},
                        {"processor_milliseconds", costs.processor},
                        {"samples_per_pixel", costs.samples_per_pixel}});
    table.rows.push_back({fmt::format("{} {} x {}", name, width, height),
                          fmt::format("{:.1f}", 1e3 / costs.milliseconds), fmt::format("{:.1f}", costs.milliseconds),
                          fmt::format("{:.1f}", costs.processor), fmt::format("{:.2f}", costs.samples_per_pixel)});
  };
  Progress bar("pictures", static_cast<double>(options.sizes.size() + 2));
  double done = 0;
  for (const auto& [width, height] : options.sizes) {
    add("picture", width, height, Measure(run, width, height, options.frames));
    bar.Update(++done);
  }
  const Camera& own = run.scene.frames[static_cast<size_t>(run.scene.train.front())].camera;
  const int64_t width = std::max<int64_t>(1, own.width / 2), height = std::max<int64_t>(1, own.height / 2);
  add("preview", width, height, Measure(run, width, height, options.frames));
  bar.Update(++done);
  if (!options.sizes.empty()) {
    const auto [w, h] = options.sizes[options.sizes.size() / 2];
    add("float32", w, h, Measure(WithKernel(run, "fp32"), w, h, options.frames));
    const auto [least_w, least_h] = *std::min_element(options.sizes.begin(), options.sizes.end());
    const int64_t few = std::min<int64_t>(options.frames, 3);
    add("modules", least_w, least_h, Measure(WithKernel(run, "modules"), least_w, least_h, few));
  }
  StartPhaseClock();
  const PictureCosts clocked = Measure(run, 2 * width, 2 * height, 1);
  const PhaseSeconds phases = StopPhaseClock();  // of two pictures: one warms up
  bar.Finish();
  BenchmarkTable split;
  const Json shares = PhaseShares(phases, 2e-3 * clocked.milliseconds * static_cast<double>(NumThreads()), &split);
  split.title = "where the threads' time goes";
  result.tables = {table, split};
  result.json = {{"key_points", run.field->num_key_points()},
                 {"steps", run.counters.step},
                 {"march_steps", run.config.render.march_steps},
                 {"pictures", pictures},
                 {"phases", shares}};
  return result;
}

}  // namespace editnerf
