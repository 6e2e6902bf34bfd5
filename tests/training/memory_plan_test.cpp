#include "libeditnerf/training/memory_plan.h"

#include <map>

#include "libeditnerf/config/yaml.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

Scene SmallScene(int64_t frames) {
  SyntheticOptions options;
  options.frames = frames;
  options.val_frames = 2;
  options.edit_frames = 0;
  options.width = 32;
  options.height = 18;
  options.samples_per_side = 1;
  return MakeSyntheticScene("static", options);
}

std::map<std::string, int64_t> PlanOf(const std::string& config, int64_t frames, int64_t samples = 0) {
  const Scene scene = SmallScene(frames);
  Config loaded = LoadConfig(EDITNERF_SOURCE_DIR "/configs/" + config + ".yaml");
  if (samples > 0) loaded.train.samples_per_step = samples;
  const Run run = MakeRun(loaded, FieldStage::kTrain, scene, torch::zeros({frames, 0, 3}), torch::kCPU);
  std::map<std::string, int64_t> parts;
  const MemoryPlan plan = PlanMemory(run, scene);
  for (const auto& [name, bytes] : plan.parts) parts[name] = bytes;
  parts["total"] = plan.Total();
  return parts;
}

}  // namespace

TEST_CASE("a memory plan counts images as bytes and parameters with gradients and moments") {
  auto plan = PlanOf("fast", 6);
  CHECK(plan["images"] == (8 + 6) * 32 * 18 * 3);  // the scene's, and the trainer's
  CHECK(plan["ground truth"] == 8 * 32 * 18 * 5);
  const int64_t table = 12 * 32768 * 2 * 4;
  CHECK(plan["field"] > table);
  CHECK(plan["field"] < table + 100'000);
  CHECK(plan["gradients"] == plan["field"]);
  CHECK(plan["Adam"] == 2 * plan["field"]);
  int64_t sum = -plan["total"];
  for (const auto& [name, bytes] : plan) sum += bytes;
  CHECK(sum == plan["total"]);
}

TEST_CASE("a memory plan grows with frames and with samples, each where it belongs") {
  auto few = PlanOf("fast", 4), many = PlanOf("fast", 8), large = PlanOf("fast", 4, 4 * 32768);
  CHECK(many["images"] - few["images"] == 2 * 4 * 32 * 18 * 3);
  CHECK(many["samples of a step"] == few["samples of a step"]);
  CHECK(large["samples of a step"] > few["samples of a step"]);
  CHECK(large["images"] == few["images"]);
  CHECK(PlanOf("paper", 4)["samples of a step"] > int64_t{10} << 30);  // why the paper's batches need a cluster
}

TEST_CASE("a memory plan reads in MiB, without what is too little to see") {
  const int64_t mebibyte = 1 << 20;
  const MemoryPlan plan = {{{"images", 20 * mebibyte}, {"field", 5 * mebibyte / 2}, {"occupancy", 1000}}};
  CHECK(SizesText(plan) == "23 MiB: images 20, field 2.5");
  CHECK(ToText(plan) == "memory beside LibTorch: 23 MiB: images 20, field 2.5");
}
