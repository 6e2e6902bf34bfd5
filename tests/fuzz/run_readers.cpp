#include <torch/types.h>

#include "libeditnerf/training/run.h"
#include "tests/fuzz/readers.h"
#include "tests/fuzz/small_scene.h"

namespace editnerf::fuzz {
namespace {

// A run's one file, as every program that shows a run opens it.
void ReadCheckpointInput(const std::string& input) {
  LoadRun(InputFile("run/checkpoint.safetensors", input).parent_path());
}

// Of both kinds of field, with everything that can be built, and small: most of the file is its configuration.
Config SmallestConfig(const char* kind) {
  Config config;
  config.field.kind = kind;
  config.field.warp.depth = config.field.weights.depth = config.field.slicing.depth = config.field.nerf.depth = 2;
  config.field.warp.width = config.field.weights.width = config.field.slicing.width = config.field.nerf.width = 4;
  config.field.warp.skip_layer = config.field.slicing.skip_layer = config.field.nerf.skip_layer = 1;
  config.field.nerf.color_width = 4;
  config.field.fast.canonical_hash.num_levels = 2;
  config.field.fast.canonical_hash.log2_table_size = 4;
  config.field.fast.local_hash = config.field.fast.canonical_hash;
  config.field.fast.width = 8;
  config.render.occupancy_resolution = 8;
  if (config.field.kind == "fast") config.render.sampler = "occupancy";
  return config;
}

std::vector<std::string> CheckpointSeeds() {
  const auto folder = InputFolder() / "seed";
  std::vector<std::string> seeds;
  for (const char* kind : {"paper", "fast"}) {
    const bool pretrain = seeds.empty();
    SaveRun(MakeRun(SmallestConfig(kind), pretrain ? FieldStage::kPretrain : FieldStage::kTrain, SmallScene(),
                    pretrain ? torch::Tensor() : torch::rand({2, 2, 3}), torch::kCPU),
            folder);
    seeds.push_back(FileContent(folder / "checkpoint.safetensors"));
  }
  return seeds;
}

}  // namespace

std::vector<Reader> RunReaders() { return {{"checkpoint", ReadCheckpointInput, CheckpointSeeds}}; }

}  // namespace editnerf::fuzz
