#include "libeditnerf/benchmarks/field_kernel_cases.h"

#include <ATen/record_function.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <atomic>
#include <map>
#include <string_view>

#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr int64_t kSamples = 512;

Config SmallConfig() {
  Config config;
  HashEncodingConfig& hash = config.field.fast.canonical_hash;
  hash.num_levels = 4, hash.log2_table_size = 10, hash.base_resolution = 4, hash.finest_resolution = 32;
  config.field.fast.local_hash = hash;
  config.field.weights.depth = 2, config.field.weights.width = 16;
  config.field.weights.output_init = config.field.slicing.output_init = 0.3;
  config.field.slicing.depth = 2, config.field.slicing.width = 16, config.field.slicing.skip_layer = 0;
  config.render.occupancy_resolution = 8;
  return config;
}

// With features of any size, so that everything matters.
FieldSetting MakeSetting(const FieldParts& parts, const std::string& kernel) {
  torch::manual_seed(2);
  FieldSetting setting = MakeFieldSetting(SmallConfig(), parts, kernel, kSamples);
  const torch::NoGradGuard no_grad;
  for (const auto& item : setting.field->named_parameters()) {
    if (item.key().find("_table") != std::string::npos) item.value().uniform_(-1, 1);
  }
  return setting;
}

struct Found {
  torch::Tensor density, color;
  double loss = 0;
  std::map<std::string, torch::Tensor> gradients;
};

Found Find(const FieldSetting& setting) {
  Found found = {DensityOfPoints(setting), ColorOfRays(setting), AddLossGradients(setting), {}};
  for (const auto& item : setting.field->named_parameters()) {
    if (item.value().grad().defined()) found.gradients[item.key()] = item.value().grad().clone();
    item.value().mutable_grad() = torch::Tensor();
  }
  return found;
}

double RelativeDifference(const torch::Tensor& found, const torch::Tensor& expected) {
  return (found - expected).norm().item<double>() / std::max(expected.norm().item<double>(), 1e-9);
}

std::atomic<int64_t> g_look_ups{0};

std::unique_ptr<at::ObserverContext> CountLookUp(const at::RecordFunction& function) {
  if (std::string_view(function.name()) == "aten::index_select") ++g_look_ups;
  return nullptr;
}

// How often LibTorch picks rows of a tensor.
int64_t CountLookUps(const std::function<void()>& call) {
  g_look_ups = 0;
  const at::CallbackHandle handle = at::addThreadLocalCallback(at::RecordFunctionCallback(CountLookUp));
  call();
  at::removeCallback(handle);
  return g_look_ups;
}

}  // namespace

TEST_CASE("the fused pass and its reference in plain operations compute the same, whatever the field is made of") {
  for (const FieldParts& parts : AllFieldParts()) {
    for (const std::string& kernel : FusedKernelsHere()) {
      INFO(parts.name << ", " << kernel);
      const FieldSetting setting = MakeSetting(parts, kernel);
      REQUIRE(setting.field->Fused());
      const Found fused = Find(setting);
      const PlainOperations only;
      REQUIRE_FALSE(setting.field->Fused());
      const Found plain = Find(setting);
      const double allowed = kernel == "fp32" ? 1e-4 : 0.1;
      CHECK(RelativeDifference(fused.density, plain.density) < allowed);
      CHECK(RelativeDifference(fused.color, plain.color) < allowed);
      CHECK(fused.loss == Approx(plain.loss).epsilon(allowed));
      CHECK(fused.gradients.size() == plain.gradients.size());
      for (const auto& [name, gradient] : plain.gradients) {
        INFO(name);
        REQUIRE(fused.gradients.count(name) == 1);
        CHECK(gradient.norm().item<double>() > 0);
        CHECK(RelativeDifference(fused.gradients.at(name), gradient) < allowed);
      }
    }
  }
}

TEST_CASE("a field has no parameter of what it is made without") {
  const auto names = [](const FieldParts& parts) {
    std::string all;
    for (const auto& item : MakeSetting(parts, "fp32").field->named_parameters()) all += item.key() + "\n";
    return all;
  };
  for (const FieldParts& parts : AllFieldParts()) {
    const std::string all = names(parts);
    INFO(parts.name << ":\n" << all);
    const auto has = [&](const char* name) { return all.find(name) != std::string::npos; };
    CHECK(has("key_points") == (parts.key_points > 0));
    CHECK(has("local_table") == (parts.key_points > 0));
    CHECK(has("weights.") == (parts.key_points > 1));
    CHECK(has("local_frames") == parts.local_frames);
    CHECK(has("appearance_codes") == parts.appearance);
    CHECK(has("slicing") == (parts.stage == FieldStage::kPretrain));
  }
}

TEST_CASE("cases of the field take the fused pass, and their references look up tables in LibTorch's operations") {
  const std::vector<KernelCase> cases = FieldKernelCases(SmallConfig(), kSamples);
  CHECK(cases.size() == 3 * FusedKernelsHere().size());
  const int64_t corners = 2 * SmallConfig().field.fast.canonical_hash.num_levels * 8;  // of both tables
  for (const KernelCase& one : cases) {
    INFO(one.name);
    CHECK(CountLookUps(one.kernel) < corners);
    CHECK(CountLookUps(one.reference) >= corners);
    CHECK_FALSE(PlainOperations::Wanted());
  }
}
