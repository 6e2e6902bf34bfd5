#include "libeditnerf/config/validate.h"

#include <fmt/format.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/config/schema.h"

namespace editnerf {
namespace {

using Found = std::optional<ConfigViolation>;

Found OutOfRange(const Setting& setting) {
  if (!InRange(setting)) {
    return ConfigViolation{setting.path, fmt::format("'{}': expected {}, found '{}'", setting.path,
                                                     Expectation(setting), ValueText(setting))};
  }
  for (const Setting& child : setting.children)
    if (Found found = OutOfRange(child)) return found;
  return std::nullopt;
}

template <class Network>
Found BadSkip(const Network& network, const std::string& path) {
  if (network.skip_layer < network.depth) return std::nullopt;
  return ConfigViolation{path + ".skip_layer",
                         fmt::format("{0}.skip_layer is {1}, expected less than {0}.depth ({2}), or 0", path,
                                     network.skip_layer, network.depth)};
}

Found BadResolutions(const HashEncodingConfig& hash, const std::string& path) {
  if (hash.base_resolution <= hash.finest_resolution) return std::nullopt;
  return ConfigViolation{path + ".finest_resolution",
                         fmt::format("{0}.finest_resolution is {1}, expected at least {0}.base_resolution ({2})", path,
                                     hash.finest_resolution, hash.base_resolution)};
}

Found BadSchedule(const StageConfig& stage, const std::string& path) {
  if (stage.final_learning_rate <= stage.learning_rate) return std::nullopt;
  return ConfigViolation{path + ".final_learning_rate",
                         fmt::format("{0}.final_learning_rate is {1}, expected at most {0}.learning_rate ({2})", path,
                                     stage.final_learning_rate, stage.learning_rate)};
}

Found MissingWeights(const FlowConfig& flow) {
  if (flow.method != "raft" || !flow.weights.empty()) return std::nullopt;
  return ConfigViolation{"flow.method", "flow.method is raft, which takes a file in flow.weights"};
}

}  // namespace

std::optional<ConfigViolation> FindViolation(const Config& config) {
  Config copy = config;  // a description points into a mutable struct
  if (Found found = OutOfRange(Describe(copy))) return found;
  const FieldConfig& field = config.field;
  if (Found found = BadSkip(field.warp, "field.warp")) return found;
  if (Found found = BadSkip(field.slicing, "field.slicing")) return found;
  if (Found found = BadSkip(field.nerf, "field.nerf")) return found;
  if (Found found = BadResolutions(field.fast.canonical_hash, "field.fast.canonical_hash")) return found;
  if (Found found = BadResolutions(field.fast.local_hash, "field.fast.local_hash")) return found;
  if (Found found = BadResolutions(field.fast.shade_hash, "field.fast.shade_hash")) return found;
  if (Found found = BadSchedule(config.pretrain, "pretrain")) return found;
  if (Found found = BadSchedule(config.train, "train")) return found;
  if (Found found = MissingWeights(config.flow)) return found;
  return std::nullopt;
}

void ValidateConfig(const Config& config, const std::string& where) {
  if (const Found found = FindViolation(config)) Throw<ConfigError>("{}: {}", where, found->message);
}

}  // namespace editnerf
