#include "libeditnerf/training/run.h"

#include <fstream>
#include <functional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

// The message with which the run is refused whose checkpoint `change` has been at; empty where it is read.
std::string RefusedAfter(const fs::path& folder, const std::function<void(SafetensorsFile*)>& change) {
  const fs::path path = folder / "checkpoint.safetensors";
  SaveRun(MakeRun(SmallFast(), FieldStage::kTrain, TinyScene(), TrueTracks(TinyScene()), torch::kCPU), folder);
  SafetensorsFile file = ReadSafetensors(path);
  change(&file);
  WriteSafetensors(path, file.tensors, file.metadata);
  try {
    LoadRun(folder);
  } catch (const CheckpointError& error) {
    return error.what();
  }
  return "";
}

std::string RefusedWithSetting(const fs::path& folder, const std::function<void(Config*)>& change) {
  return RefusedAfter(folder, [&](SafetensorsFile* file) {
    Config config = LoadConfigText(file->metadata.at("config"), "config");
    change(&config);
    file->metadata["config"] = ToYaml(config);
  });
}

}  // namespace

TEST_CASE("a checkpoint that is damaged, cut off or of another kind is refused by name") {
  const fs::path folder = Scratch("damaged");
  CHECK_THROWS_WITH(LoadRun(folder), HasText("checkpoint.safetensors: no checkpoint here"));
  SaveRun(MakeRun(SmallFast(), FieldStage::kTrain, TinyScene(), TrueTracks(TinyScene()), torch::kCPU), folder);
  CHECK_NOTHROW(LoadRun(folder));
  const fs::path path = folder / "checkpoint.safetensors";
  fs::resize_file(path, fs::file_size(path) / 2);
  CHECK_THROWS_AS(LoadRun(folder), CheckpointError);
  std::ofstream(path) << "not a checkpoint";
  CHECK_THROWS_AS(LoadRun(folder), CheckpointError);
  fs::remove_all(folder);
}

TEST_CASE("a checkpoint that announces sizes which it does not have is refused before memory is taken for them") {
  const TrainingFolder folder("absurd");
  const std::string too_small = " numbers in its tensors, expected at least ";
  CHECK(RefusedAfter(folder.path(), [](SafetensorsFile*) {}).empty());
  // Every one of these takes half a gigabyte or more by itself.
  const std::vector<std::function<void(Config*)>> absurd = {
      [](Config* config) {
        config->field.fast.canonical_hash = {32, 8, 24, 16, 512};
      },
      [](Config* config) {
        config->field.fast.local_hash = {32, 8, 24, 16, 512};
      },
      [](Config* config) {
        config->field.warp = {Choice::kOn, 6, 80000, 32, 4096};
      },
      [](Config* config) { config->render.occupancy_resolution = 512; },
      [](Config* config) {
        config->field.kind = "paper", config->field.nerf.depth = 32, config->field.nerf.width = 4096;
      },
  };
  for (size_t i = 0; i < absurd.size(); ++i) {
    INFO("case " << i);
    CHECK_THAT(RefusedWithSetting(folder.path(), absurd[i]), HasText(too_small));
  }
  // Parts that only some runs have.
  const auto wide = [&](auto network, const char* key, const char* value) {
    return RefusedAfter(folder.path(), [&](SafetensorsFile* file) {
      Config config = LoadConfigText(file->metadata.at("config"), "config");
      (config.field.*network).depth = 32, (config.field.*network).width = 4096;
      file->metadata["config"] = ToYaml(config);
      file->metadata[key] = value;
    });
  };
  CHECK_THAT(wide(&FieldConfig::weights, "key_points", "2"), HasText(too_small));
  CHECK_THAT(wide(&FieldConfig::slicing, "stage", "pretrain"), HasText(too_small));
}

TEST_CASE("a checkpoint whose metadata is wrong is refused with its name and what was expected") {
  const TrainingFolder folder("metadata");
  const auto refused = [&](const char* key, const std::string& value) {
    return RefusedAfter(folder.path(), [&](SafetensorsFile* file) { file->metadata[key] = value; });
  };
  const std::string name = (folder.path() / "checkpoint.safetensors").string();
  CHECK(refused("stage", "trane") == name + ": expected stage 'pretrain' or 'train', found 'trane'");
  CHECK(refused("key_points", "65") == name + ": expected 0 to 64 key points, found 65");
  for (const auto& [key, value] : std::map<std::string, std::string>{{"key_points", "many"},
                                                                     {"counters", "{}"},
                                                                     {"scene", "[]"},
                                                                     {"box", "[0, 0, 0, 1, 1]"},
                                                                     {"config", "field: [1]"}}) {
    INFO(key);
    CHECK_THAT(refused(key.c_str(), value), HasText(name));
  }
  const auto without_table = [](SafetensorsFile* file) { file->tensors.erase("field.fine.local_table"); };
  CHECK_THAT(RefusedAfter(folder.path(), without_table), HasText(name));
}

TEST_CASE("a checkpoint from before shade was turned to the light is read with the scene's axes") {
  const TrainingFolder folder("before_lamps");
  const Scene scene = SmallScene("cups", 10, 48);
  Config config = SmallFast();
  config.field.fast.shade = true;
  const torch::Tensor tracks = torch::rand({static_cast<int64_t>(scene.train.size()), 2, 3});
  const auto axes_after = [&](bool removed) {
    SaveRun(MakeRun(config, FieldStage::kTrain, scene, tracks, torch::kCPU, {}, Vec3{0, 0.6, 0.8}), folder.path());
    const fs::path path = folder.path() / "checkpoint.safetensors";
    SafetensorsFile file = ReadSafetensors(path);
    REQUIRE(file.tensors.count("field.fine.shade_axes") == 1);
    if (removed) file.tensors.erase("field.fine.shade_axes");
    WriteSafetensors(path, file.tensors, file.metadata);
    return LoadRun(folder.path()).field->named_buffers()["fine.shade_axes"].clone();
  };
  CHECK(torch::equal(axes_after(true), torch::eye(3)));
  CHECK(torch::allclose(axes_after(false)[2], torch::tensor({0.0F, 0.15F, 0.2F})));
}
