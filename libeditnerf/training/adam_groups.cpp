#include "libeditnerf/training/adam_groups.h"

#include <torch/nn/module.h>

#include <string>

namespace editnerf {
namespace {

bool Contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

// The networks that bend, slice and divide space. At the rate of the hash encodings' small networks their neurons can
// die: the ambient coordinates of a scene that moves then become one constant.
bool IsShape(const std::string& name) {
  return name.rfind("warp.", 0) == 0 || name.rfind("slicing.", 0) == 0 || name.rfind("weights.", 0) == 0 ||
         name.rfind("local_frames.", 0) == 0;
}

}  // namespace

std::vector<AdamGroup> AdamGroupsFor(const HyperspaceField& field, const StageConfig& stage) {
  AdamGroup networks, shape, tables, codes, key_points;
  shape.learning_rate_factor = stage.shape_learning_rate;
  tables.skip_untouched = true;
  codes.learning_rate_factor = stage.code_learning_rate;
  key_points.learning_rate_factor = stage.key_point_learning_rate;
  if (field.has_local_frames() && stage.hinge_learning_rate != 1) {
    const torch::Tensor hinged = field.local_frames()->about_one_axis;
    key_points.entry_factor = (1 + hinged * (stage.hinge_learning_rate - 1)).view({1, -1, 1});  // of [T, N, 3]
  }
  for (const auto& item : field.named_parameters()) {
    AdamGroup& group = Contains(item.key(), "codes.")        ? codes
                       : Contains(item.key(), "key_points.") ? key_points
                       : Contains(item.key(), "_table")      ? tables
                       : IsShape(item.key())                 ? shape
                                                             : networks;
    group.parameters.emplace_back(item.key(), item.value());
  }
  return {networks, shape, tables, codes, key_points};
}

AdamOptions AdamOptionsFor(const Config& config) {
  // The paper's networks take Adam's usual constants, hash encodings those of Mueller et al. (2022).
  return config.field.kind == "fast" ? AdamOptions{0.9, 0.99, 1e-15} : AdamOptions{0.9, 0.999, 1e-8};
}

}  // namespace editnerf
