// What a benchmark found: tables to read and JSON to keep.
#pragma once

#include <string>
#include <vector>

#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/imaging/json_file.h"

namespace editnerf {

struct BenchmarkTable {
  std::string title;
  std::vector<std::string> headers;
  std::vector<std::vector<std::string>> rows;
};

// Columns side by side, each as wide as its widest cell; all but the first to the right.
std::string ToText(const BenchmarkTable& table);

struct BenchmarkResult {
  std::vector<BenchmarkTable> tables;
  Json json;
};

// {"processor": ..., "instruction_set": ..., "threads": ..., "version": ..., "commit": ..., "libtorch": ...}
Json MachineJson();

// Shares of the phases in `seconds` of all threads together, and what is in none of them as "rest", waiting included;
// the same as rows of `table`.
Json PhaseShares(const PhaseSeconds& phases, double seconds, BenchmarkTable* table);

}  // namespace editnerf
