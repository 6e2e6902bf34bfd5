#include "libeditnerf/pipeline/whole_way.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/imaging/video_file.h"
#include "libeditnerf/pipeline/rendering.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "libeditnerf/training/run.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

namespace fs = std::filesystem;

Config Small() {
  Config config = LoadConfig(fs::path(EDITNERF_SOURCE_DIR) / "configs" / "fast.yaml");
  config.render.march_steps = 24;
  config.render.occupancy_resolution = 16;
  config.field.fast.canonical_hash.num_levels = 6;
  config.field.fast.canonical_hash.log2_table_size = 12;
  config.field.fast.local_hash = config.field.fast.canonical_hash;
  config.field.fast.density_bias = 0;
  config.field.fast.ambient_window_delay = config.field.fast.ambient_window_steps = 20;
  config.detect.min_observations = 3;
  config.detect.rigid_parts = false;  // eight frames of 48 pixels show none
  for (StageConfig* stage : {&config.pretrain, &config.train}) {
    stage->steps = 150;
    stage->seconds = 0;
    stage->rays_per_step = 256;
    stage->log_every = 10;
    stage->evaluate_every = 75;
  }
  return config;
}

}  // namespace

TEST_CASE("the whole way leads from a scene folder to a report, and is not walked twice") {
  const ScratchFolder scratch;
  SyntheticOptions options;
  options.frames = 8;
  options.val_frames = options.edit_frames = 2;
  options.width = 48;
  options.height = 27;
  options.samples_per_side = 2;
  WriteSceneFolder(MakeSyntheticScene("hinge", options), scratch.path() / "scene");

  WholeWayRequest request;
  request.input = scratch.path() / "scene";
  request.work = scratch.path() / "work";
  request.config = Small();
  RunWholeWay(request);
  for (const char* file : {"scene/scene.json", "scene/data/detection.json", "pretrained/checkpoint.safetensors",
                           "pretrained/surface_maps.safetensors", "run/checkpoint.safetensors", "run/metrics.csv",
                           "report/index.html", "report/scores.json", "report/edited.mp4", "report/strip.png"}) {
    INFO(file);
    CHECK(fs::exists(request.work / file));
  }
  CHECK_FALSE(fs::exists(request.input / "data"));  // the given folder is left as it was
  const auto scores = nlohmann::json::parse(ReadFile(request.work / "report" / "scores.json"));
  CHECK(scores.at("reconstruction.psnr").is_number());
  CHECK(VideoReader(request.work / "report" / "edited.mp4").width() == 48);

  const auto trained = fs::last_write_time(request.work / "run" / "checkpoint.safetensors");
  RunWholeWay(request);
  CHECK(fs::last_write_time(request.work / "run" / "checkpoint.safetensors") == trained);

  request.config.train.learning_rate *= 2;
  CHECK_THROWS_WITH(RunWholeWay(request), HasText("begun with another configuration"));

  const Run run = LoadRun(request.work / "run");
  RenderOutput output;
  output.path = scratch.path() / "frames";
  output.depth = true;
  RenderFrames(run, PlanFrames(run, "val"), output);
  CHECK(fs::exists(output.path / "000008.png"));
  CHECK(fs::exists(output.path / "000008_depth.png"));
  CHECK_THROWS_AS(PlanFrames(run, "nobody"), DataError);
}

TEST_CASE("the whole way names an input that is not there") {
  const ScratchFolder scratch;
  WholeWayRequest request;
  request.input = scratch.path() / "clip.mp4";
  request.work = scratch.path() / "work";
  CHECK_THROWS_WITH(RunWholeWay(request), HasText("clip.mp4: no such file or folder"));
}
