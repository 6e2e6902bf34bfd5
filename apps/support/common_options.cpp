#include "support/common_options.h"

#include <torch/cuda.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/config/reference.h"
#include "libeditnerf/config/validate.h"
#include "libeditnerf/config/yaml.h"
#include "support/config_files.h"

namespace editnerf {
namespace {

void ApplyOverrides(Config& config, const std::vector<std::string>& overrides) {
  for (const std::string& assignment : overrides) ApplyOverride(config, assignment);
  if (!overrides.empty()) ValidateConfig(config, "--set");
}

// What CLI11 does for --version, which ends the line itself.
[[noreturn]] void PrintAndExit(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  throw CLI::CallForVersion(text, 0);
}

torch::Device ResolveDevice(const std::string& name) {
  if (name == "cpu") return torch::kCPU;
  if (torch::cuda::is_available()) return torch::kCUDA;
  if (name == "cuda") Throw<ConfigError>("--device cuda: no CUDA device is available; use --device cpu or auto");
  return torch::kCPU;
}

}  // namespace

Config CommonOptions::Over(const Config& run_config) const {
  if (config_given) return config;
  Config merged = run_config;
  ApplyOverrides(merged, overrides);
  return merged;
}

void CommonFlags::AddTo(CLI::App& app) {
  constexpr const char* kGroup = "Common options";
  app.add_option("--config", config_, "YAML file, or fast, fine, paper or tiny (default: fast)")
      ->type_name("FILE")
      ->group(kGroup);
  app.add_option("--set", overrides_, "one setting on top of --config, e.g. train.steps=100; repeatable")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->group(kGroup);
  app.add_option("--device", device_, "auto, cpu or cuda")
      ->type_name("DEVICE")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}).description(""))
      ->capture_default_str()
      ->group(kGroup);
  app.add_option("--threads", threads_, "threads; 0 for every core")
      ->type_name("N")
      ->check(CLI::Range(int64_t{0}, int64_t{4096}).description(""))
      ->capture_default_str()
      ->group(kGroup);
  app.add_option("--seed", seed_, "seed of every random number")
      ->type_name("N")
      ->check(CLI::NonNegativeNumber.description(""))
      ->capture_default_str()
      ->group(kGroup);
  CLI::Option* const verbose = app.add_flag("--verbose", verbose_, "debug messages")->group(kGroup);
  app.add_flag("--quiet", quiet_, "warnings and errors alone")->excludes(verbose)->group(kGroup);
  // Options are looked at in the order of these lines, and before it is checked that nothing required is missing.
  app.add_flag_callback(
         "--print-config", [this] { PrintAndExit(ToYaml(LoadedConfig())); },
         "print the configuration that would be used, and exit")
      ->group(kGroup);
  app.add_flag_callback(
         "--print-config-reference", [] { PrintAndExit(ConfigReference()); }, "print docs/configuration.md, and exit")
      ->group("");
}

Config CommonFlags::LoadedConfig() const {
  Config config = LoadNamedConfig(config_.value_or(kDefaultConfig));
  ApplyOverrides(config, overrides_);
  return config;
}

CommonOptions CommonFlags::Apply() const {
  SetLogLevel(verbose_ ? LogLevel::kDebug : quiet_ ? LogLevel::kWarning : LogLevel::kInfo);
  CommonOptions options;
  options.overrides = overrides_;
  options.config_given = config_.has_value();
  options.config = LoadedConfig();
  options.device = ResolveDevice(device_);
  options.seed = seed_;
  options.threads = threads_;
  SetNumThreads(threads_);
  torch::manual_seed(seed_);
  return options;
}

}  // namespace editnerf
