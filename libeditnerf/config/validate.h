// What makes a configuration as a whole usable: every range, and the settings that must fit each other.
#pragma once

#include <optional>
#include <string>

#include "libeditnerf/config/config.h"

namespace editnerf {

struct ConfigViolation {
  std::string path;     // of the setting to blame
  std::string message;  // "field.nerf.skip_layer is 9, expected less than field.nerf.depth (8), or 0"
};

// The first violation: ranges first, in the order of the structs, then
//   skip_layer < depth, or 0               for field.warp, field.slicing and field.nerf
//   base_resolution <= finest_resolution   for both hash encodings
//   final_learning_rate <= learning_rate   for both stages
std::optional<ConfigViolation> FindViolation(const Config& config);

// Throws ConfigError "where: message" unless there is none.
void ValidateConfig(const Config& config, const std::string& where);

}  // namespace editnerf
