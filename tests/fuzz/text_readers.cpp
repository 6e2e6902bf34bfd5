#include "libeditnerf/config/yaml.h"
#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/scene/scene_json.h"
#include "libeditnerf/training/metrics_log.h"
#include "tests/fuzz/readers.h"
#include "tests/fuzz/small_scene.h"

namespace editnerf::fuzz {
namespace {

using Inputs = std::vector<std::string>;

std::string Name() { return InputFolder().string(); }

void ReadYamlInput(const std::string& input) { LoadConfigText(input, Name()); }

Inputs YamlSeeds() {
  return {"train: {steps: 100, seconds: 60}\nfield:\n  kind: fast  # a comment\n  fast: {local_frames: true}\n",
          "pretrain:\n  steps: &a 7\ntrain:\n  steps: *a\nflow:\n  weights: \"a\\x20b\"\n  method: 'dis'\n",
          "---\n? train\n: {steps: 3}\n...\n"};
}

void ReadOverrideInput(const std::string& input) {
  Config config;
  ApplyOverride(config, input, Name());
}

Inputs OverrideSeeds() { return {"train.steps=100", "train={steps: 7, seconds: 3}"}; }

void ReadCameraInput(const std::string& input) { ReadCameraFile(InputFile("a.json", input)); }

Inputs CameraSeeds() { return {CameraToJson(SmallCamera()).dump()}; }

void ReadEditInput(const std::string& input) {
  const EditFile edit = ParseEditFile(input, Name());
  WriteEditFile(edit);
}

Inputs EditSeeds() {
  EditFile edit;
  edit.width = 4, edit.height = 3;
  edit.frames.resize(3);
  edit.frames[0].key_points = {Vec3{0, 0.5, 1}, std::nullopt};
  edit.frames[0].camera_frame = "a";
  edit.frames[1].code_frame = "b";
  edit.frames[1].camera = SmallCamera();
  edit.frames[2].code_frame = "a";
  edit.frames[2].camera = SmallCamera();
  return {WriteEditFile(edit)};
}

void ReadSceneJsonInput(const std::string& input) { SceneFromJson(input, Name()); }

Inputs SceneJsonSeeds() { return {SceneToJson(SmallScene())}; }

void ReadMetricsInput(const std::string& input) { ReadMetricsLog(InputFile("metrics.csv", input)); }

Inputs MetricsSeeds() {
  return {
      "seconds_training,seconds_total,step,rays,samples,loss.a,held_out_psnr\n0.5,1e3,10,20,30,0.25,\n1,2,3,4,5,,31."
      "5\n"};
}

}  // namespace

std::vector<Reader> TextReaders() {
  return {{"yaml", ReadYamlInput, YamlSeeds},
          {"override", ReadOverrideInput, OverrideSeeds},
          {"camera", ReadCameraInput, CameraSeeds},
          {"edit", ReadEditInput, EditSeeds},
          {"scene_json", ReadSceneJsonInput, SceneJsonSeeds},
          {"metrics", ReadMetricsInput, MetricsSeeds}};
}

}  // namespace editnerf::fuzz
