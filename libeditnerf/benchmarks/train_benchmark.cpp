#include "libeditnerf/benchmarks/train_benchmark.h"

#include <fmt/format.h>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/machine.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/benchmarks/timing.h"
#include "libeditnerf/training/memory_plan.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {
namespace {

constexpr int64_t kModuleStepsShare = 6;  // module by module a step takes longer

struct StepCosts {
  double seconds = 0, processor = 0;  // of a step
  double samples = 0, rays = 0;       // of a step
};

StepCosts Measure(Trainer& trainer, int64_t steps) {
  const RunCounters before = trainer.run().counters;
  const double processor = ProcessorSeconds();
  const Stopwatch watch;
  for (int64_t i = 0; i < steps; ++i) {
    if (InterruptRequested()) Throw<Interrupted>("benchmark stopped by request");
    trainer.Step();
  }
  const auto count = static_cast<double>(steps);
  StepCosts costs;
  costs.seconds = watch.Seconds() / count;
  costs.processor = (ProcessorSeconds() - processor) / count;
  costs.samples = static_cast<double>(trainer.run().counters.samples - before.samples) / count;
  costs.rays = static_cast<double>(trainer.run().counters.rays - before.rays) / count;
  return costs;
}

double MedianOf(const std::vector<StepCosts>& all, const std::function<double(const StepCosts&)>& value) {
  std::vector<double> values;
  for (const StepCosts& costs : all) values.push_back(value(costs));
  return Median(values);
}

struct Medians {
  double samples_per_second, rays_per_second, step_seconds, processor_ns_per_sample, samples_per_ray;
};

Medians MediansOf(const std::vector<StepCosts>& all) {
  return {MedianOf(all, [](const StepCosts& c) { return c.samples / c.seconds; }),
          MedianOf(all, [](const StepCosts& c) { return c.rays / c.seconds; }),
          MedianOf(all, [](const StepCosts& c) { return c.seconds; }),
          MedianOf(all, [](const StepCosts& c) { return 1e9 * c.processor / c.samples; }),
          MedianOf(all, [](const StepCosts& c) { return c.samples / c.rays; })};
}

Json ToJson(const Medians& m) {
  return {{"samples_per_second", m.samples_per_second},
          {"rays_per_second", m.rays_per_second},
          {"step_seconds", m.step_seconds},
          {"processor_ns_per_sample", m.processor_ns_per_sample},
          {"samples_per_ray", m.samples_per_ray}};
}

std::vector<std::string> Row(const std::string& name, const Medians& m) {
  return {name,
          fmt::format("{:.3f} M", 1e-6 * m.samples_per_second),
          fmt::format("{:.1f} k", 1e-3 * m.rays_per_second),
          fmt::format("{:.1f}", m.samples_per_ray),
          fmt::format("{:.1f}", 1e3 * m.step_seconds),
          fmt::format("{:.0f}", m.processor_ns_per_sample)};
}

Json MemoryJson(const MemoryPlan& plan) {
  Json json;
  for (const auto& [name, bytes] : plan.parts) json["parts"][name] = bytes;
  json["total"] = plan.Total();
  return json;
}

}  // namespace

BenchmarkResult RunTrainBenchmark(const BenchScene& bench, const Config& config, const TrainBenchmark& options) {
  const Run fresh = MakeBenchRun(config, options.stage, bench, options.device);
  const MemoryPlan plan = PlanMemory(fresh, bench.scene);
  const Run warm = TrainBriefly(fresh, bench.scene, options.warm_up, 0);
  Config by_modules = config;
  by_modules.field.fast.kernel = "modules";
  Trainer fused(CopyRun(warm, config, bench), bench.scene, std::nullopt, {});
  Trainer modules(CopyRun(warm, by_modules, bench), bench.scene, std::nullopt, {});
  fused.Step(), modules.Step();  // sizes settle
  std::vector<StepCosts> fused_costs, module_costs;
  std::vector<double> ratios;
  for (int64_t i = 0; i < options.repeats; ++i) {
    fused_costs.push_back(Measure(fused, options.steps));
    module_costs.push_back(Measure(modules, std::max<int64_t>(1, options.steps / kModuleStepsShare)));
    ratios.push_back(module_costs.back().processor / module_costs.back().samples /
                     (fused_costs.back().processor / fused_costs.back().samples));
  }
  StartPhaseClock();
  const StepCosts clocked = Measure(fused, options.steps);
  const PhaseSeconds phases = StopPhaseClock();

  const Medians fused_medians = MediansOf(fused_costs), module_medians = MediansOf(module_costs);
  BenchmarkResult result;
  result.tables.push_back({fmt::format("training steps of {}", bench.source),
                           {"", "samples/s", "rays/s", "samples/ray", "ms/step", "processor ns/sample"},
                           {Row("fused", fused_medians), Row("modules", module_medians)}});
  BenchmarkTable split;
  result.json = {{"scene", bench.source},
                 {"stage", options.stage == FieldStage::kPretrain ? "pretrain" : "train"},
                 {"key_points", warm.field->num_key_points()},
                 {"steps_before", options.warm_up},
                 {"fused", ToJson(fused_medians)},
                 {"modules", ToJson(module_medians)},
                 {"ratio", Median(ratios)},
                 {"memory_plan", MemoryJson(plan)}};
  const double seconds = clocked.seconds * static_cast<double>(options.steps * NumThreads());
  result.json["phases"] = PhaseShares(phases, seconds, &split);
  split.title = "where the threads' time goes (fused)";
  result.tables.push_back(split);
  result.tables.push_back(
      {fmt::format("fused is {:.2f} times as fast as modules, by processor time; {}", Median(ratios), ToText(plan)),
       {},
       {}});
  return result;
}

}  // namespace editnerf
