#include "support/config_files.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/config/yaml.h"
#include "support/builtin_configs.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

std::optional<fs::path> FindBesideProgram(const std::string& name) {
  std::error_code code;
  const fs::path program = fs::read_symlink("/proc/self/exe", code);
  if (code) return std::nullopt;
  const fs::path file = name + ".yaml";
  const fs::path installed = program.parent_path().parent_path() / EDITNERF_DATADIR / "editnerf/configs" / file;
  if (fs::is_regular_file(installed, code)) return installed;
  const bool in_build_folder = program.string().rfind(EDITNERF_BINARY_DIR "/", 0) == 0;
  const fs::path source = fs::path(EDITNERF_SOURCE_DIR) / "configs" / file;
  if (in_build_folder && fs::is_regular_file(source, code)) return source;
  return std::nullopt;
}

}  // namespace

std::vector<std::string> ConfigNames() {
  std::vector<std::string> names;
  for (const BuiltinConfig& config : BuiltinConfigs()) names.emplace_back(config.name);
  return names;
}

Config LoadShortName(const std::string& name) {
  for (const BuiltinConfig& builtin : BuiltinConfigs()) {
    if (name != builtin.name) continue;
    if (const auto path = FindBesideProgram(name)) {
      LogDebug("configuration: {}", path->string());
      return LoadConfig(*path, LoadShortName);
    }
    LogDebug("configuration: {} (built in)", builtin.name);
    return LoadConfigText(builtin.text, std::string(builtin.name) + ".yaml (built in)", LoadShortName);
  }
  Throw<ConfigError>("expected one of {}, found '{}'", fmt::join(ConfigNames(), ", "), name);
}

Config LoadNamedConfig(const std::string& name_or_path) {
  const std::vector<std::string> names = ConfigNames();
  if (std::find(names.begin(), names.end(), name_or_path) != names.end()) return LoadShortName(name_or_path);
  std::error_code code;
  if (!fs::exists(name_or_path, code)) {
    Throw<ConfigError>("{}: no such configuration; expected a YAML file or one of {}", name_or_path,
                       fmt::join(names, ", "));
  }
  LogDebug("configuration: {}", name_or_path);
  return LoadConfig(name_or_path, LoadShortName);
}

}  // namespace editnerf
