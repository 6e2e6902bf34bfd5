// The tables of RunTablesBenchmark from its JSON.
#pragma once

#include <string>
#include <vector>

#include "libeditnerf/benchmarks/benchmark_result.h"

namespace editnerf {

// {"scenes": [{"name", "seeds": [{"rows": {NAME: scores of enf-eval and "depth"}, "ladder": [{"name", "description"}],
// "key_points", "known_depth", "flow"}]}]} -> fields, ablation, depth, key points, flow; those without rows are left
// out.
std::vector<BenchmarkTable> LayOutTables(const Json& json);

// "24.97" of one value, "24.97 (24.69 to 25.31)" of several, "-" of none; nulls are passed over.
std::string MeanAndRange(const std::vector<Json>& values, int digits);

}  // namespace editnerf
