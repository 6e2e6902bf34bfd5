#include "libeditnerf/training/adam_groups.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <map>
#include <string>

#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("every parameter learns at the stage's rate for its kind, and in one group alone") {
  torch::manual_seed(1);
  HyperspaceFieldOptions options;
  options.config.kind = "fast";
  options.config.fast.shade = true;
  options.box = {{-1, -1, -1}, {1, 1, 1}};
  options.stage = FieldStage::kTrain;
  options.num_frames = 4;
  options.num_key_points = 2;
  options.initial_tracks = torch::rand({4, 2, 3});
  options.initial_turns = torch::rand({4, 2, 3});
  const HyperspaceField field(options);
  StageConfig stage;
  stage.key_point_learning_rate = 0.1;
  stage.turn_learning_rate = 0.2;
  stage.code_learning_rate = 0.3;
  stage.shape_learning_rate = 0.4;
  stage.shade_decay = 0.5;
  stage.settle_after = 7;
  std::map<std::string, AdamGroup> of;
  for (const AdamGroup& group : AdamGroupsFor(field, stage)) {
    for (const auto& [name, parameter] : group.parameters) CHECK(of.emplace(name, group).second);
  }
  CHECK(of.size() == field.named_parameters().size());
  const auto rate = [&](const std::string& name) { return of.at(name).learning_rate_factor; };
  CHECK(rate("key_points.local") == 0.1);
  CHECK(rate("local_frames.output_weight") == 0.2);
  CHECK(of.at("key_points.local").settle_after == 7);
  CHECK(of.at("local_frames.output_weight").settle_after == 7);
  CHECK(of.at("fine.canonical_table").settle_after == 0);
  CHECK(rate("fine.canonical_table") == 1);
  CHECK(of.at("fine.canonical_table").skip_untouched);
  CHECK(of.at("fine.canonical_table").decay == 0);
  CHECK(of.at("fine.shade_table").decay == 0.5);
  const auto all_learn_at = [&](const std::string& prefix, double wanted) {
    int64_t met = 0;
    for (const auto& [name, group] : of) {
      if (name.rfind(prefix, 0) != 0) continue;
      CHECK(group.learning_rate_factor == wanted);
      ++met;
    }
    CHECK(met > 0);
  };
  all_learn_at("appearance_codes.", 0.3);
  all_learn_at("weights.", 0.4);
  all_learn_at("fine.density_network.", 1);
  all_learn_at("fine.color_network.", 1);
}
