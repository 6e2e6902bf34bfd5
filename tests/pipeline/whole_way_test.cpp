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
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

namespace fs = std::filesystem;

constexpr int64_t kUntilSurfaces = 400;  // steps of pretraining until there is depth to detect on

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

// A small scene by this name in folder/scene, on its way to folder/work.
WholeWayRequest Request(const fs::path& folder, const char* scene) {
  SyntheticOptions options;
  options.frames = 8;
  options.val_frames = options.edit_frames = 2;
  options.width = 48;
  options.height = 27;
  options.samples_per_side = 2;
  WriteSceneFolder(MakeSyntheticScene(scene, options), folder / "scene");
  WholeWayRequest request;
  request.input = folder / "scene";
  request.work = folder / "work";
  request.config = Small();
  return request;
}

// What every way that ends well has to leave behind; returns the report's text.
std::string CheckEndedWell(const WholeWayRequest& request, int64_t key_points) {
  const Run run = LoadRun(request.work / "run");  // asks for finite weights
  CHECK(run.field->num_key_points() == key_points);
  CHECK(run.counters.step == request.config.train.steps);
  CHECK(run.counters.skipped == 0);
  const auto scores = nlohmann::json::parse(ReadFile(request.work / "report" / "scores.json"));
  CHECK(scores.at("reconstruction.psnr").is_number());  // a NaN would be null
  return ReadFile(request.work / "report" / "index.html");
}

}  // namespace

TEST_CASE("the whole way leads from a scene folder to a report, and is not walked twice") {
  const ScratchFolder scratch;
  WholeWayRequest request = Request(scratch.path(), "hinge");
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

TEST_CASE("a scene in which nothing moves goes the whole way, without key points and with a note that says so") {
  const ScratchFolder scratch;
  for (const bool rigid_parts : {false, true}) {
    INFO("rigid parts: " << rigid_parts);
    const fs::path folder = scratch / (rigid_parts ? "rigid" : "free");
    WholeWayRequest request = Request(folder, "static");
    request.config.detect.rigid_parts = rigid_parts;
    request.config.pretrain.steps = kUntilSurfaces;
    RunWholeWay(request);
    CHECK_THAT(
        CheckEndedWell(request, 0),
        HasText(rigid_parts ? "no rigid part found that moves: the scene looks static" : "no moving part found"));
  }
}

TEST_CASE("eight key points asked of one moving part are all tracked, trained and reported") {
  const ScratchFolder scratch;
  WholeWayRequest request = Request(scratch.path(), "hinge");
  request.config.detect.count = 8;
  request.config.train.merge_key_points = Choice::kOff;  // they are on one part, and may well be shown to be the same
  request.config.pretrain.steps = kUntilSurfaces;
  RunWholeWay(request);
  const std::string report = CheckEndedWell(request, 8);
  CHECK_THAT(report, HasText("kept because the number of key points is given"));
  CHECK_THAT(report, HasText("detection: light"));  // where it comes from, or that nothing tells it
}

TEST_CASE("the whole way refuses a record of stages that is broken, and names it") {
  const ScratchFolder scratch;
  const WholeWayRequest request = Request(scratch.path(), "hinge");
  const fs::path path = request.work / "stages.json";
  const auto refused = [&](const std::string& text) {
    WriteText(path, text);
    return MessageOf<Error>([&] { RunWholeWay(request); });
  };
  CHECK_THAT(refused("{\"scene\": 1"), StartsWithText(path.string() + ": "));
  CHECK(refused("[1, 2]") == path.string() + ": expected an object; remove it to begin again");
  CHECK(refused("{\"scene\": \"yes\"}") ==
        path.string() + ": 'scene': expected seconds, found \"yes\"; remove the entry to repeat the stage");
  // Done by the book, but gone: what is missing is named.
  CHECK_THAT(refused("{\"scene\": 1}"), HasText((request.work / "scene").string()));
  fs::create_directory_symlink(request.input, request.work / "scene");
  CHECK_THAT(refused("{\"scene\": 1, \"pretrain\": 1}"), HasText((request.work / "pretrained").string()));
}

TEST_CASE("the whole way names an input that is not there") {
  const ScratchFolder scratch;
  WholeWayRequest request;
  request.input = scratch.path() / "clip.mp4";
  request.work = scratch.path() / "work";
  CHECK_THROWS_WITH(RunWholeWay(request), HasText("clip.mp4: no such file or folder"));
}
