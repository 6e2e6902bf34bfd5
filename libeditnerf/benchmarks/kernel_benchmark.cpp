#include "libeditnerf/benchmarks/kernel_benchmark.h"

#include <fmt/format.h>

#include <set>

#include "libeditnerf/base/parallel.h"
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

}  // namespace

BenchmarkResult RunKernelBenchmark(const Config& config, const KernelBenchmark& options) {
  const ThreadsGuard guard;
  const std::set<int64_t> all_threads = {1, options.threads > 0 ? options.threads : NumThreads()};
  std::vector<KernelCase> cases = FieldKernelCases(config, options.samples);
  for (KernelCase& other : TensorKernelCases(config, options.samples)) cases.push_back(std::move(other));
  for (KernelCase& other : Bf16KernelCases(config, options.samples)) cases.push_back(std::move(other));
  Progress bar("kernels", static_cast<double>(cases.size() * all_threads.size()));
  double done = 0;
  BenchmarkResult result;
  result.json = {{"samples", options.samples}, {"repeats", options.repeats}, {"runs", Json::array()}};
  for (const int64_t threads : all_threads) {
    SetNumThreads(threads);
    const double peak = MeasurePeakFlops();
    BenchmarkTable table;
    table.title =
        fmt::format("{} thread{}; peak of a core {:.0f} GFLOP/s", threads, threads == 1 ? "" : "s", 1e-9 * peak);
    table.headers = {"", "ns", "processor ns", "reference's", "ratio", "GFLOP/s a core", "of peak"};
    Json kernels = Json::array();
    for (const KernelCase& kernel : cases) {
      const PairTiming timing = TimePair(kernel.kernel, kernel.reference, options.repeats, options.least_seconds);
      const double nanoseconds = 1e9 * timing.body.seconds / kernel.count;
      const double processor = 1e9 * timing.body.processor / kernel.count;
      const double reference = 1e9 * timing.reference.processor / kernel.count;
      Json one = {{"name", kernel.name},
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
        one["gflops"] = 1e-9 * flops;
        const double most = kernel.peak > 0 ? kernel.peak : peak;
        one["peak_gflops"] = 1e-9 * most;
        one["share_of_peak"] = flops / most;
        row[5] = fmt::format("{:.1f}", 1e-9 * flops);
        row[6] = fmt::format("{:.0f} %", 100 * flops / most);
      }
      kernels.push_back(one);
      table.rows.push_back(row);
      bar.Update(++done);
    }
    result.json["runs"].push_back({{"threads", threads}, {"peak_gflops", 1e-9 * peak}, {"kernels", kernels}});
    result.tables.push_back(table);
  }
  bar.Finish();
  return result;
}

}  // namespace editnerf
