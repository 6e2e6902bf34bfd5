// The flags that every program takes.
//
//   --help --version
//   --config FILE       a YAML file, or fast (the default), fine, paper, tiny
//   --set KEY=VALUE     one setting on top; repeatable, in order
//   --device DEVICE     auto (the default: CUDA where there is a device), cpu or cuda
//   --threads N         0 (the default): every core that the process may use
//   --seed N            of every random number; the default is 1
//   --verbose --quiet   debug messages; warnings and errors alone
//   --print-config      prints the configuration that would be used, as YAML, and exits; needs no input
#pragma once

#include <torch/types.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/config/config.h"

namespace editnerf {

struct CommonOptions {
  Config config;  // --config and every --set, validated
  torch::Device device = torch::kCPU;
  int64_t seed = 1;
  int64_t threads = 0;
  bool config_given = false;           // false: `config` is the default file with the overrides
  std::vector<std::string> overrides;  // "train.steps=100"

  // For programs that work on a run, which has a configuration of its own: that one, unless --config was given, with
  // every
  // --set on top. Throws ConfigError.
  Config Over(const Config& run_config) const;
};

// The flags as they were typed, before they are looked at.
class CommonFlags {
 public:
  // Adds the flags above, and a hidden --print-config-reference that prints docs/configuration.md. The app refers to
  // this object.
  void AddTo(CLI::App& app);

  // After parsing: sets the log level, the threads and LibTorch's seed, and loads the configuration.
  // Throws ConfigError, also when --device cuda finds no device.
  CommonOptions Apply() const;

 private:
  Config LoadedConfig() const;

  std::optional<std::string> config_;
  std::vector<std::string> overrides_;
  std::string device_ = "auto";
  int64_t threads_ = 0;
  int64_t seed_ = 1;
  bool verbose_ = false;
  bool quiet_ = false;
};

}  // namespace editnerf
