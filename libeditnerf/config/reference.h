// docs/configuration.md, generated from the configuration structs (a program's --print-config-reference prints it).
#pragma once

#include <string>

namespace editnerf {

// Markdown: per group of settings a table of key, type, default, accepted values and meaning.
std::string ConfigReference();

}  // namespace editnerf
