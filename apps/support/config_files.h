// Where --config finds its file.
#pragma once

#include <string>
#include <vector>

#include "libeditnerf/config/config.h"

namespace editnerf {

constexpr const char* kDefaultConfig = "fast";

// The short names: the files of configs/, without ".yaml".
std::vector<std::string> ConfigNames();

// A short name or a path to a YAML file. A short name is looked for beside the program (share/editnerf/configs of an
// installation, configs/ of the source tree for a program in its build folder), and is built into the program as well,
// so that a program that was copied alone still runs. `base` in any of them is a short name. Throws ConfigError; an
// unknown name lists the known ones.
Config LoadShortName(const std::string& name);
Config LoadNamedConfig(const std::string& name_or_path);

}  // namespace editnerf
