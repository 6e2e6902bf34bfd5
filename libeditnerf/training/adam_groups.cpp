#include "libeditnerf/training/adam_groups.h"

#include <torch/nn/module.h>

#include <string>

namespace editnerf {
namespace {

bool Contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

// The networks that bend, slice and divide space. At the rate of the hash encodings' small networks their neurons can
// die: the ambient coordinates of a scene that moves then become one constant.
bool IsShape(const std::string& name) {
  return name.rfind("warp.", 0) == 0 || name.rfind("slicing.", 0) == 0 || name.rfind("weights.", 0) == 0;
}

}  // namespace

std::vector<AdamGroup> AdamGroupsFor(const HyperspaceField& field, const StageConfig& stage) {
  AdamGroup networks, shape, tables, shade, codes, key_points, turns;
  shape.learning_rate_factor = stage.shape_learning_rate;
  tables.skip_untouched = shade.skip_untouched = true;
  shade.decay = stage.shade_decay;
  codes.learning_rate_factor = stage.code_learning_rate;
  key_points.learning_rate_factor = stage.key_point_learning_rate;
  turns.learning_rate_factor = stage.turn_learning_rate;
  key_points.settle_after = turns.settle_after = stage.settle_after;
  for (const auto& item : field.named_parameters()) {
    const std::string& name = item.key();
    AdamGroup& group = Contains(name, "codes.")          ? codes
                       : Contains(name, "key_points.")   ? key_points
                       : Contains(name, "local_frames.") ? turns
                       : Contains(name, "shade_table")   ? shade
                       : Contains(name, "_table")        ? tables
                       : IsShape(name)                   ? shape
                                                         : networks;
    group.parameters.emplace_back(name, item.value());
  }
  return {networks, shape, tables, shade, codes, key_points, turns};
}

AdamOptions AdamOptionsFor(const Config& config) {
  // The paper's networks take Adam's usual constants, hash encodings those of Mueller et al. (2022).
  return config.field.kind == "fast" ? AdamOptions{0.9, 0.99, 1e-15} : AdamOptions{0.9, 0.999, 1e-8};
}

}  // namespace editnerf
