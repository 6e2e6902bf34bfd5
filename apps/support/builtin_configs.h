// The files of configs/ as they were when the program was built (generated from them by apps/CMakeLists.txt).
#pragma once

#include <vector>

namespace editnerf {

struct BuiltinConfig {
  const char* name;  // without ".yaml"
  const char* text;
};

const std::vector<BuiltinConfig>& BuiltinConfigs();

}  // namespace editnerf
