#include "libeditnerf/benchmarks/train_benchmark.h"

#include <fmt/format.h>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/machine.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/benchmarks/timing.h"
#include "libeditnerf/kernels/kernel_use.h"
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

struct Ratios {
  double processor, clock;
};

// Medians over the turns of a sample's cost, over that of the other's in the same turn.
Ratios RatiosOf(const std::vector<StepCosts>& slow, const std::vector<StepCosts>& fast) {
  std::vector<double> processor, clock;
  for (size_t i = 0; i < slow.size(); ++i) {
    processor.push_back(slow[i].processor / slow[i].samples / (fast[i].processor / fast[i].samples));
    clock.push_back(slow[i].seconds / slow[i].samples / (fast[i].seconds / fast[i].samples));
  }
  return {Median(processor), Median(clock)};
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
  // The modules take every gradient, so what they are compared with does, too; what is configured stands beside it.
  Config all_back = config;
  all_back.pretrain.roulette = all_back.train.roulette = 0;
  Config by_modules = all_back;
  by_modules.field.fast.kernel = "modules";
  Trainer configured(CopyRun(warm, config, bench), bench.scene, std::nullopt, {});
  Trainer fused(CopyRun(warm, all_back, bench), bench.scene, std::nullopt, {});
  Trainer modules(CopyRun(warm, by_modules, bench), bench.scene, std::nullopt, {});
  Trainer plain(CopyRun(warm, by_modules, bench), bench.scene, std::nullopt, {});
  const auto measure_plainly = [&plain] {
    const PlainOperations only;
    return Measure(plain, 1);
  };
  configured.Step(), fused.Step(), modules.Step(), measure_plainly();  // sizes settle
  std::vector<StepCosts> configured_costs, fused_costs, module_costs, plain_costs;
  for (int64_t i = 0; i < options.repeats; ++i) {
    configured_costs.push_back(Measure(configured, options.steps));
    fused_costs.push_back(Measure(fused, options.steps));
    module_costs.push_back(Measure(modules, std::max<int64_t>(1, options.steps / kModuleStepsShare)));
    plain_costs.push_back(measure_plainly());
  }
  StartPhaseClock();
  const StepCosts clocked = Measure(configured, options.steps);
  const PhaseSeconds phases = StopPhaseClock();

  const Medians configured_medians = MediansOf(configured_costs), fused_medians = MediansOf(fused_costs),
                module_medians = MediansOf(module_costs), plain_medians = MediansOf(plain_costs);
  const Ratios over_modules = RatiosOf(module_costs, fused_costs), over_plain = RatiosOf(plain_costs, fused_costs);
  BenchmarkResult result;
  result.tables.push_back({fmt::format("training steps of {}", bench.source),
                           {"", "samples/s", "rays/s", "samples/ray", "ms/step", "processor ns/sample"},
                           {Row("as configured", configured_medians), Row("fused, all gradients", fused_medians),
                            Row("modules", module_medians), Row("plain LibTorch", plain_medians)}});
  BenchmarkTable split;
  result.json = {{"scene", bench.source},
                 {"stage", options.stage == FieldStage::kPretrain ? "pretrain" : "train"},
                 {"key_points", warm.field->num_key_points()},
                 {"steps_before", options.warm_up},
                 {"roulette", StageOf(warm).roulette},
                 {"configured", ToJson(configured_medians)},
                 {"fused", ToJson(fused_medians)},
                 {"modules", ToJson(module_medians)},
                 {"plain", ToJson(plain_medians)},
                 {"ratio", over_modules.processor},
                 {"ratio_to_plain", over_plain.processor},
                 {"ratio_to_plain_by_the_clock", over_plain.clock},
                 {"memory_plan", MemoryJson(plan)}};
  const double seconds = clocked.seconds * static_cast<double>(options.steps * NumThreads());
  result.json["phases"] = PhaseShares(phases, seconds, &split);
  split.title = "where the threads' time goes (as configured)";
  result.tables.push_back(split);
  result.tables.push_back(
      {fmt::format("fused, all gradients, is {:.2f} times as fast as modules by processor time, and {:.1f} times as "
                   "fast as plain LibTorch ({:.1f} by the clock); {}",
                   over_modules.processor, over_plain.processor, over_plain.clock, ToText(plan)),
       {},
       {}});
  return result;
}

}  // namespace editnerf
