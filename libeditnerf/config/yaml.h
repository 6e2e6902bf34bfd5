// Configuration files: YAML to Config and back.
//
// A file names only what it changes: everything else keeps the default of config.h, and an empty file is the defaults.
// With `base: NAME` at its top, everything else is as in the configuration of that name.
// Mistakes are ConfigErrors that name the place and, where there is one, the nearest valid name:
//   configs/dice.yaml:2: unknown key 'field.weights.num_octave'; did you mean 'num_octaves'?
//   configs/dice.yaml:5: 'train.steps': expected an integer of at least 1, found '1.5'
//   configs/dice.yaml:7: duplicate key 'train.steps', first given in line 5
//   configs/dice.yaml:9: field.nerf.skip_layer is 9, expected less than field.nerf.depth (8), or 0
// Anchors and aliases work; cyclic ones, more than 10,000 nodes, more than 32 levels, more than 1 MiB, a second
// document and unknown keys are errors.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "libeditnerf/config/config.h"

namespace editnerf {

// What `base` means; throws ConfigError for a name that it does not know.
using ConfigByName = std::function<Config(const std::string& name)>;

// Reads and validates a file. Throws ConfigError; also when it cannot be read. Without `by_name`, `base` is unknown.
Config LoadConfig(const std::filesystem::path& path, const ConfigByName& by_name = {});

// The same for text; `name` is the file name of its messages.
Config LoadConfigText(const std::string& text, const std::string& name, const ConfigByName& by_name = {});

// "train.steps=100", the value in YAML ("train={steps: 100, seconds: 60}" sets two). Checks the key, the type and the
// range; ValidateConfig checks the whole once all overrides are in. `where` opens the messages:
//   --set train.steps=0: 'train.steps': expected an integer of at least 1, found '0'
void ApplyOverride(Config& config, const std::string& assignment, const std::string& where = "--set");

// Every setting, in the order of the structs. LoadConfigText(ToYaml(c), ...) gives c exactly.
std::string ToYaml(const Config& config);

}  // namespace editnerf
