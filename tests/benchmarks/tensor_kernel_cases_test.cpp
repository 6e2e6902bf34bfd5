#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>

#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/config/yaml.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

const KernelCase& Named(const std::vector<KernelCase>& cases, const std::string& name) {
  const auto found = std::find_if(cases.begin(), cases.end(), [&](const auto& one) { return one.name == name; });
  REQUIRE(found != cases.end());
  return *found;
}

}  // namespace

TEST_CASE("the sparse steps of Adam that are measured touch half of a table, as those of training do") {
  torch::manual_seed(1);
  const Config config = LoadConfig(EDITNERF_SOURCE_DIR "/configs/fast.yaml");
  const std::vector<KernelCase> cases = TensorKernelCases(config, 1024);
  const KernelCase &dense = Named(cases, "Adam, a parameter"),
                   &sparse = Named(cases, "sparse Adam, a touched parameter");
  CHECK(sparse.count > 0.45 * dense.count);
  CHECK(sparse.count < 0.6 * dense.count);
}
