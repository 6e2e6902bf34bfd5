#include "libeditnerf/config/reference.h"

#include <filesystem>

#include "libeditnerf/base/file.h"
#include "tests/catch.h"

namespace editnerf {

TEST_CASE("docs/configuration.md is what the structs say") {
  const std::filesystem::path path = std::filesystem::path(EDITNERF_SOURCE_DIR) / "docs/configuration.md";
  INFO("to write it anew: enf --print-config-reference > docs/configuration.md");
  CHECK((ReadFile(path) == ConfigReference()));
}

TEST_CASE("the reference lists key, type, default, values and meaning") {
  const std::string text = ConfigReference();
  const auto contains = [&](const char* line) { return text.find(line) != std::string::npos; };
  CHECK(contains("| `field.warp.depth` | integer | 6 | 1 to 32 | hidden layers of the trunk |"));
  CHECK(contains("| `field.kind` | text | paper | paper, fast | parameterisation of the hyperspace |"));
  CHECK(contains("| `train.learning_rate` | number | 0.001 | > 0 | initial learning rate of Adam |"));
  CHECK(contains("| `detect.refine` | boolean | true | true, false | refine every track by robust least squares |"));
  CHECK(contains("use rgb/\\<factor>x"));
}

}  // namespace editnerf
