// A small scene to be edited: five cameras in a row that look along z, and two key points, one of which moves along x
// and away from the cameras while the other one moves up.
#pragma once

#include <torch/types.h>
#include <torch/utils.h>

#include <memory>
#include <string>
#include <vector>

#include "libeditnerf/config/yaml.h"
#include "libeditnerf/editing/edit_session.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

constexpr int64_t kFixtureFrames = 5;

inline Scene FixtureScene() {
  Scene scene;
  scene.name = "fixture";
  scene.transform.scale = 2;
  scene.transform.center = {1, 0, 0};
  scene.transform.near = 0.5;
  scene.transform.far = 2;
  for (int64_t f = 0; f < kFixtureFrames; ++f) {
    Camera camera;
    camera.position = {0.02 * static_cast<double>(f) - 0.04, 0, -1};
    camera.focal_length = 40;
    camera.principal_point = {16, 9};
    camera.width = 32;
    camera.height = 18;
    scene.frames.push_back({"frame" + std::to_string(f), f, f, camera});
    scene.train.push_back(f);
  }
  scene.images = torch::zeros({kFixtureFrames, 18, 32, 3}, torch::kUInt8);
  return scene;
}

// [T, 2, 3]
inline torch::Tensor FixtureTracks() {
  auto tracks = torch::zeros({kFixtureFrames, 2, 3}, torch::kFloat64);
  const auto along = torch::arange(kFixtureFrames, torch::kFloat64) / static_cast<double>(kFixtureFrames - 1);
  tracks.select(1, 0).select(1, 0).copy_(0.2 * along - 0.1);
  tracks.select(1, 0).select(1, 2).copy_(0.1 * along);
  tracks.select(1, 1).select(1, 1).copy_(-0.1 * along);
  return tracks;
}

inline std::shared_ptr<const EditableScene> FixtureEditableScene() {
  auto scene = std::make_shared<EditableScene>();
  scene->scene = FixtureScene();
  scene->tracks = KeyPointTracks(FixtureTracks());
  scene->box = {{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
  return scene;
}

// The fast field with random contents, so that pictures show something that depends on the key points.
inline Run FixtureRun(const std::vector<std::string>& settings = {}) {
  torch::manual_seed(3);
  Config config = LoadConfig(std::string(EDITNERF_SOURCE_DIR) + "/configs/fast.yaml");
  config.field.fast.canonical_hash.log2_table_size = config.field.fast.local_hash.log2_table_size = 10;
  config.render.occupancy_resolution = 16;
  for (const std::string& setting : settings) ApplyOverride(config, setting);
  Run run = MakeRun(config, FieldStage::kTrain, FixtureScene(), FixtureTracks().to(torch::kFloat32), torch::kCPU);
  const torch::NoGradGuard no_grad;
  for (const auto& item : run.field->named_parameters()) {
    if (item.key().find("key_points") == std::string::npos) {
      item.value().add_(torch::randn_like(item.value()) * 0.3);
    }
  }
  run.field->SetStep(100000);
  run.field->eval();
  return run;
}

}  // namespace editnerf
