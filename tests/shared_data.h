// Where the shared example data lies beside a checkout, if it does; tests that need it are skipped visibly otherwise.
#pragma once

#include <filesystem>
#include <optional>

namespace editnerf {

inline std::optional<std::filesystem::path> SharedData() {
  for (const char* up : {"..", "../.."}) {
    const std::filesystem::path path = std::filesystem::path(EDITNERF_SOURCE_DIR) / up / "shared";
    if (std::filesystem::exists(path)) return path;
  }
  return std::nullopt;
}

}  // namespace editnerf
