#include "libeditnerf/benchmarks/stability_benchmark.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>

#include "libeditnerf/base/progress.h"
#include "libeditnerf/benchmarks/stability_cases.h"

namespace editnerf {
namespace {

Json NumberOrNull(double number) { return std::isfinite(number) ? Json(number) : Json(); }

Json ToJson(const StabilityRow& row) {
  Json json = {{"operation", row.operation}, {"situation", row.situation},
               {"variant", row.variant},     {"error", NumberOrNull(row.value.error)},
               {"bound", row.value.bound},   {"gradient_error", nullptr},
               {"gradient_bound", nullptr},  {"finite", row.finite},
               {"passes", row.Passes()}};
  if (row.gradient) {
    json["gradient_error"] = NumberOrNull(row.gradient->error);
    json["gradient_bound"] = row.gradient->bound;
  }
  return json;
}

std::vector<std::string> ToCells(const StabilityRow& row) {
  const auto cell = [](double number) { return fmt::format("{:.1e}", number); };
  std::vector<std::string> cells = {row.operation + ": " + row.situation, row.variant, cell(row.value.error),
                                    cell(row.value.bound)};
  cells.push_back(row.gradient ? cell(row.gradient->error) : "");
  cells.push_back(row.gradient ? cell(row.gradient->bound) : "");
  cells.emplace_back(row.finite ? "yes" : "NO");
  cells.emplace_back(row.Passes() ? "pass" : "FAIL");
  return cells;
}

void AddIntegration(const StabilityBenchmark& options, BenchmarkResult* result) {
  BenchmarkTable table = {"dT/ds = -sigma T along a ray: error of its colour against run time",
                          {"way", "thickness", "steps", "error", "processor ns a sample", "processor us a ray"},
                          {}};
  result->json["integration"] = Json::array();
  for (const IntegrationPoint& point : IntegrationErrors(options.repeats, options.least_seconds)) {
    table.rows.push_back({point.way, fmt::format("{:g}", point.thickness), std::to_string(point.steps),
                          fmt::format("{:.1e}", point.error), fmt::format("{:.2f}", point.nanoseconds),
                          fmt::format("{:.2f}", 1e-3 * point.nanoseconds * static_cast<double>(point.steps))});
    result->json["integration"].push_back({{"way", point.way},
                                           {"thickness", point.thickness},
                                           {"steps", point.steps},
                                           {"error", NumberOrNull(point.error)},
                                           {"nanoseconds", point.nanoseconds}});
  }
  result->tables.push_back(table);
}

}  // namespace

BenchmarkResult RunStabilityBenchmark(const StabilityBenchmark& options) {
  const std::vector<std::function<StabilityRows()>> groups = {
      CompositingStability,        SoftmaxStability,        DensityStability,    RigidMotionStability,
      PositionalEncodingStability, HashEncodingStability,   ProjectionStability, NetworkStability,
      MarchingStability,           FusedPassStability,      DistortionStability, EarlyStopStability,
      LocalFrameStability,         KeyPointWeightStability, LookUpStability};
  Progress bar("stability", static_cast<double>(groups.size() + 1));
  BenchmarkResult result;
  result.json = {{"rows", Json::array()}};
  BenchmarkTable table = {"largest relative errors",
                          {"operator: situation", "variant", "error", "at most", "gradient", "at most", "finite", ""},
                          {}};
  int64_t failed = 0;
  double done = 0;
  for (const auto& group : groups) {
    for (const StabilityRow& row : group()) {
      table.rows.push_back(ToCells(row));
      result.json["rows"].push_back(ToJson(row));
      failed += static_cast<int64_t>(!row.Passes());
    }
    bar.Update(++done);
  }
  result.json["failed"] = failed;
  result.tables.push_back(table);
  AddIntegration(options, &result);
  bar.Finish();
  return result;
}

}  // namespace editnerf
