#include "libeditnerf/training/warm_start.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

Config SmallConfig(const char* kind) {
  Config config;
  config.field.kind = kind;
  config.field.warp.enabled = Choice::kOff;
  config.field.use_appearance = Choice::kOff;
  config.render.sampler = "occupancy";
  config.render.occupancy_resolution = 8;
  HashEncodingConfig& hash = config.field.fast.canonical_hash;
  hash.num_levels = 3, hash.log2_table_size = 6, hash.base_resolution = 2, hash.finest_resolution = 8;
  config.field.fast.local_hash = hash;
  config.field.fast.width = 8;
  return config;
}

const Scene& TinyScene() {
  static const Scene scene = [] {
    SyntheticOptions options;
    options.frames = 4, options.val_frames = 1, options.edit_frames = 0;
    options.width = 16, options.height = 8, options.samples_per_side = 1;
    return MakeSyntheticScene("hinge", options);
  }();
  return scene;
}

Run Pretrained(const Config& config) {
  Run run = MakeRun(config, FieldStage::kPretrain, TinyScene(), torch::Tensor(), torch::kCPU);
  const torch::NoGradGuard no_grad;
  for (const auto& item : run.field->named_parameters()) item.value().fill_(0.5);
  return run;
}

Run ToTrain(const Config& config) {
  return MakeRun(config, FieldStage::kTrain, TinyScene(), torch::rand({4, 1, 3}), torch::kCPU);
}

}  // namespace

TEST_CASE("training takes over the static scene of pretraining, and nothing else") {
  torch::manual_seed(1);
  const Config config = SmallConfig("fast");
  const Run pretrained = Pretrained(config);
  Run run = ToTrain(config);
  const torch::Tensor local = run.field->named_parameters()["fine.local_table"].detach().clone();
  const torch::Tensor first = run.field->named_parameters()["fine.density_network.hidden0.weight"].detach().clone();
  CHECK(TakeOverStaticScene(pretrained, &run) > 0);
  const auto now = run.field->named_parameters();
  for (const char* name :
       {"fine.canonical_table", "fine.color_network.hidden0.weight", "fine.color_network.output.bias",
        "fine.density_network.output.weight", "fine.density_network.hidden0.bias"}) {
    INFO(name);
    CHECK(now[name].eq(0.5).all().item<bool>());
  }
  CHECK(torch::equal(now["fine.local_table"], local));
  const torch::Tensor weights = now["fine.density_network.hidden0.weight"];
  CHECK(weights.slice(1, 0, 6).eq(0.5).all().item<bool>());  // three levels of two features
  CHECK(torch::equal(weights.slice(1, 6), first.slice(1, 6)));
}

TEST_CASE("nothing is taken over from a field of another size, or from one that is no pretraining") {
  torch::manual_seed(2);
  const Config config = SmallConfig("fast");
  Config larger = config;
  larger.field.fast.canonical_hash.num_levels = 4;
  Run run = ToTrain(config);
  const torch::Tensor table = run.field->named_parameters()["fine.canonical_table"].detach().clone();
  CHECK(TakeOverStaticScene(Pretrained(larger), &run) == 0);
  CHECK(torch::equal(run.field->named_parameters()["fine.canonical_table"], table));
  CHECK_THROWS_AS(TakeOverStaticScene(ToTrain(config), &run), ConfigError);
}
