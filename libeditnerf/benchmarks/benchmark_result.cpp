#include "libeditnerf/benchmarks/benchmark_result.h"

#include <fmt/format.h>
#include <torch/version.h>

#include <algorithm>

#include "libeditnerf/base/machine.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/kernels/machine_peak.h"

namespace editnerf {

std::string ToText(const BenchmarkTable& table) {
  std::vector<size_t> widths(table.headers.size(), 0);
  const auto widen = [&](const std::vector<std::string>& cells) {
    for (size_t i = 0; i < cells.size(); ++i) widths[i] = std::max(widths[i], cells[i].size());
  };
  widen(table.headers);
  for (const auto& row : table.rows) widen(row);
  std::string text = table.title + "\n";
  const auto append = [&](const std::vector<std::string>& cells) {
    for (size_t i = 0; i < cells.size(); ++i) {
      text += i == 0 ? fmt::format("  {:<{}}", cells[i], widths[i]) : fmt::format("  {:>{}}", cells[i], widths[i]);
    }
    text += "\n";
  };
  append(table.headers);
  for (const auto& row : table.rows) append(row);
  return text;
}

Json PhaseShares(const PhaseSeconds& phases, double seconds, BenchmarkTable* table) {
  Json shares;
  double rest = 1;
  table->headers = {"phase", "share"};
  const auto add = [&](const char* name, double share) {
    shares[name] = share;
    table->rows.push_back({name, fmt::format("{:.1f} %", 100 * share)});
    rest -= share;
  };
  for (size_t i = 0; i < kNumPhases; ++i) add(PhaseName(static_cast<Phase>(i)), phases[i] / seconds);
  add("rest", rest);
  return shares;
}

Json MachineJson() {
  return {{"processor", ProcessorName()}, {"instruction_set", InstructionSet()}, {"threads", NumThreads()},
          {"version", LibraryVersion()},  {"commit", LibraryCommit()},           {"libtorch", TORCH_VERSION}};
}

}  // namespace editnerf
