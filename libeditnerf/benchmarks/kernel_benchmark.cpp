#include "libeditnerf/benchmarks/kernel_benchmark.h"

#include <fmt/format.h>

#include <set>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/benchmarks/timing.h"
#include "libeditnerf/kernels/machine_peak.h"

namespace editnerf {
namespace {

class ThreadsGuard {
 public:
  ThreadsGuard() : before_(NumThreads()) {}
  ~ThreadsGuard() { SetNumThreads(before_); }
  ThreadsGuard(const ThreadsGuard&) = delete;
  ThreadsGuard& operator=(const ThreadsGuard&) = delete;

 private:
  int64_t before_;
};

std::string ThreadsText(int64_t threads) { return fmt::format("{} thread{}", threads, threads == 1 ? "" : "s"); }

// A row of the table of all kernels, and the same as JSON.
Json MeasureKernel(const KernelCase& kernel, double peak, const KernelBenchmark& options, BenchmarkTable* table) {
  const PairTiming timing = TimePair(kernel.kernel, kernel.reference, options.repeats, options.least_seconds);
  const double nanoseconds = 1e9 * timing.body.seconds / kernel.count;
  const double processor = 1e9 * timing.body.processor / kernel.count;
  const double reference = 1e9 * timing.reference.processor / kernel.count;
  Json json = {{"name", kernel.name},
               {"nanoseconds", nanoseconds},
               {"processor_nanoseconds", processor},
               {"reference_processor_nanoseconds", reference},
               {"ratio", timing.ratio}};
  std::vector<std::string> row = {kernel.name,
                                  fmt::format("{:.1f}", nanoseconds),
                                  fmt::format("{:.1f}", processor),
                                  fmt::format("{:.1f}", reference),
                                  fmt::format("{:.2f}", timing.ratio),
                                  "",
                                  ""};
  if (kernel.operations > 0) {
    const double flops = kernel.operations * kernel.count / timing.body.processor;
    json["gflops"] = 1e-9 * flops;
    const double most = kernel.peak > 0 ? kernel.peak : peak;
    json["peak_gflops"] = 1e-9 * most;
    json["share_of_peak"] = flops / most;
    row[5] = fmt::format("{:.1f}", 1e-9 * flops);
    row[6] = fmt::format("{:.0f} %", 100 * flops / most);
  }
  table->rows.push_back(row);
  return json;
}

// Of the time of all threads during these calls, the share of each phase of the fused pass. By the clock, as phases are
// counted: what the machine does beside makes all of them longer.
PhaseSeconds SharesOfPhases(const std::function<void()>& call, int64_t calls) {
  StartPhaseClock();
  const Stopwatch watch;
  for (int64_t i = 0; i < calls; ++i) call();
  const double all_threads = watch.Seconds() * static_cast<double>(NumThreads());
  PhaseSeconds shares = StopPhaseClock();
  for (double& share : shares) share /= all_threads;
  return shares;
}

constexpr Phase kPhasesOfRays[] = {Phase::kProducts, Phase::kEncoding, Phase::kTableGradients, Phase::kMarching,
                                   Phase::kCompositing};

BenchmarkTable PartsTable(const std::string& kernel, int64_t threads) {
  BenchmarkTable table;
  table.title = fmt::format("field along rays, both ways, by what a scene needs: {}, {}, processor ns a sample", kernel,
                            ThreadsText(threads));
  table.headers = {"", "k operations", "ns", "of N = 1"};
  for (const Phase phase : kPhasesOfRays) table.headers.emplace_back(PhaseName(phase));
  table.headers.emplace_back("rest");
  return table;
}

struct PartsTiming {
  double of_one_key_point;  // by turns with it
  double one_key_point;     // nanoseconds of the processor for one of its samples, meanwhile
  PhaseSeconds shares;
};

PartsTiming TimeParts(const KernelCase& parts, const KernelBenchmark& options) {
  const PairTiming timing = TimePair(parts.kernel, parts.reference, options.repeats, options.least_seconds);
  return {1 / timing.ratio, 1e9 * timing.reference.processor / parts.count,
          SharesOfPhases(parts.kernel, options.repeats)};
}

// A row of the table of the field's parts, and the same as JSON, given what one key point takes.
Json ReportParts(const KernelCase& parts, const PartsTiming& timing, double one_key_point, BenchmarkTable* table) {
  const double nanoseconds = timing.of_one_key_point * one_key_point;
  Json json = {{"name", parts.name},
               {"operations", parts.operations},
               {"processor_nanoseconds", nanoseconds},
               {"of_one_key_point", timing.of_one_key_point}};
  std::vector<std::string> row = {parts.name, fmt::format("{:.1f}", 1e-3 * parts.operations),
                                  fmt::format("{:.0f}", nanoseconds), fmt::format("{:.2f}", timing.of_one_key_point)};
  double rest = 1;
  const auto add = [&](const char* name, double share) {
    json["phases"][name] = share * nanoseconds;
    row.push_back(fmt::format("{:.0f}", share * nanoseconds));
    rest -= share;
  };
  for (const Phase phase : kPhasesOfRays) add(PhaseName(phase), timing.shares[static_cast<size_t>(phase)]);
  add("rest", rest);
  table->rows.push_back(row);
  return json;
}

// Times of rows that were measured one after the other do not compare where a machine is shared, ratios by turns do: so
// a row's time is its ratio to one key point's, the median over all rows.
Json MeasureParts(const std::vector<KernelCase>& cases, const std::string& kernel, const KernelBenchmark& options,
                  BenchmarkTable* table) {
  std::vector<PartsTiming> timings;
  std::vector<double> one_key_point;
  for (const KernelCase& parts : cases) {
    timings.push_back(TimeParts(parts, options));
    one_key_point.push_back(timings.back().one_key_point);
  }
  Json all = Json::array();
  for (size_t i = 0; i < cases.size(); ++i) {
    all.push_back(ReportParts(cases[i], timings[i], Median(one_key_point), table));
    all.back()["kernel"] = kernel;
  }
  return all;
}

}  // namespace

BenchmarkResult RunKernelBenchmark(const Config& config, const KernelBenchmark& options) {
  const ThreadsGuard guard;
  const std::set<int64_t> all_threads = {1, options.threads > 0 ? options.threads : NumThreads()};
  std::vector<KernelCase> cases = FieldKernelCases(config, options.samples);
  for (KernelCase& other : TensorKernelCases(config, options.samples)) cases.push_back(std::move(other));
  for (KernelCase& other : Bf16KernelCases(config, options.samples)) cases.push_back(std::move(other));
  Progress bar("kernels", static_cast<double>(all_threads.size()));
  double done = 0;
  BenchmarkResult result;
  result.json = {{"samples", options.samples}, {"repeats", options.repeats}, {"runs", Json::array()}};
  for (const int64_t threads : all_threads) {
    SetNumThreads(threads);
    const double peak = MeasurePeakFlops();
    Json run = {{"threads", threads}, {"peak_gflops", 1e-9 * peak}};
    BenchmarkTable table;
    table.title = fmt::format("{}; peak of a core {:.0f} GFLOP/s", ThreadsText(threads), 1e-9 * peak);
    table.headers = {"", "ns", "processor ns", "reference's", "ratio", "GFLOP/s a core", "of peak"};
    for (const KernelCase& kernel : cases) {
      run["kernels"].push_back(MeasureKernel(kernel, peak, options, &table));
      bar.Update(done += 0.5 / static_cast<double>(cases.size()));
    }
    result.tables.push_back(table);
    const std::vector<std::string> kernels = FusedKernelsHere();
    for (const std::string& kernel : kernels) {
      BenchmarkTable parts = PartsTable(kernel, threads);
      for (const Json& one : MeasureParts(FieldPartCases(config, kernel, options.samples), kernel, options, &parts)) {
        run["field_parts"].push_back(one);
      }
      result.tables.push_back(parts);
      bar.Update(done += 0.5 / static_cast<double>(kernels.size()));
    }
    result.json["runs"].push_back(run);
  }
  bar.Finish();
  return result;
}

}  // namespace editnerf
