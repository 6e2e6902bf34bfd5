#include "libeditnerf/tracking/detection_run.h"

#include <fmt/format.h>

#include <filesystem>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/tracking/detection_pictures.h"
#include "moving_spheres.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

DetectionConfig SmallConfig() {
  DetectionConfig config;
  config.volume_resolution = 48;
  config.min_observations = 3;
  config.relative_threshold = 0.3;  // the clip is free of noise
  return config;
}

}  // namespace

TEST_CASE("a detection run refines its tracks and draws its pictures") {
  const MovingSpheres clip = RenderMovingSpheres({Sliding({0, 0, 0.2}, {0.35, 0.1, 0}, 1, 30)});
  const DetectionRun run = RunDetection(clip.scene, clip.maps, SmallConfig());
  REQUIRE(run.detection.count() == 1);
  REQUIRE(run.refined.size() == 1);
  CHECK(run.refined[0].before.motion_terms > 15);
  CHECK(run.refined[0].after.motion < 1.0);
  CHECK(torch::isfinite(run.detection.tracks).all().item<bool>());

  const torch::Tensor variance = VariancePicture(run.detection),
                      tracks = TracksPicture(clip.scene, run.detection, 5, 3);
  CHECK(variance.scalar_type() == torch::kUInt8);
  CHECK(variance.size(2) == 3);
  CHECK(variance.to(torch::kFloat32).std().item<double>() > 1);
  CHECK(tracks.sizes() == torch::IntArrayRef({2 * 240, 3 * 320, 3}));

  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "editnerf_detection_run_test";
  std::filesystem::remove_all(folder);
  WriteDetection(clip.scene, run, folder);
  const KeyPointFiles files = ReadKeyPointFiles(folder);
  CHECK(torch::allclose(files.InSceneUnits(), run.detection.tracks.to(torch::kFloat64), 1e-5, 1e-5));
  CHECK(torch::equal(ReadMedianDepth(folder, "3"), run.depth[3]));
  CHECK((run.depth[3] == clip.maps.depth[3]).to(torch::kFloat32).mean().item<double>() > 0.1);
  CHECK(torch::equal(ReadFlow(folder, "3"), run.flows.forward[3]));
  for (const char* name : {"detection.json", "variance.png", "tracks.png"})
    CHECK(std::filesystem::file_size(folder / "data" / name) > 100);
  std::filesystem::remove_all(folder);
}

TEST_CASE("turns of parts come back from their file, go where none turns, and are refused where they do not fit") {
  const MovingSpheres clip = RenderMovingSpheres({Resting({0, 0, 0.2})}, {6, 64, 48});
  DetectionRun run = RunDetection(clip.scene, clip.maps, SmallConfig());
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "editnerf_part_turns_test";
  std::filesystem::remove_all(folder);
  CHECK(!ReadPartTurns(folder, 6, 2).defined());
  run.detection.turns = torch::rand({6, 2, 3});
  WriteDetection(clip.scene, run, folder);
  CHECK(torch::equal(ReadPartTurns(folder, 6, 2), run.detection.turns));
  CHECK_THROWS_WITH(ReadPartTurns(folder, 6, 1), HasText("part_turns.safetensors"));
  run.detection.turns[3][1][2] = NAN;
  WriteDetection(clip.scene, run, folder);
  CHECK_THROWS_WITH(ReadPartTurns(folder, 6, 2), HasText("not finite"));
  run.detection.turns = torch::Tensor();
  WriteDetection(clip.scene, run, folder);
  CHECK(!ReadPartTurns(folder, 6, 2).defined());
  std::filesystem::remove_all(folder);
}

TEST_CASE("the light's direction comes back from detection's file, and is refused where it is none") {
  const MovingSpheres clip = RenderMovingSpheres({Resting({0, 0, 0.2})}, {6, 64, 48});
  DetectionRun run = RunDetection(clip.scene, clip.maps, SmallConfig());
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "editnerf_lamp_file_test";
  std::filesystem::remove_all(folder);
  CHECK(!ReadLamp(folder));  // no file
  WriteDetection(clip.scene, run, folder);
  CHECK(!ReadLamp(folder));  // none found
  run.lamp = Lamp{Normalized({0.2, -0.3, 0.9}), 0.5, 0.1};
  WriteDetection(clip.scene, run, folder);
  CHECK(Norm(ReadLamp(folder).value() - run.lamp->direction) < 1e-12);
  for (const char* lamp : {"[0, 0, 0]", "[1, 2]", "\"up\"", "[1e30, 0, 0]"}) {
    WriteFileAtomically(folder / "data" / "detection.json", fmt::format("{{\"lamp\": {}}}", lamp));
    CHECK_THROWS_WITH(ReadLamp(folder), HasText("detection.json"));
  }
  std::filesystem::remove_all(folder);
}

TEST_CASE("pictures of a detection without key points are drawn too") {
  const MovingSpheres clip = RenderMovingSpheres({Resting({0, 0, 0.2})}, {6, 64, 48});
  const DetectionRun run = RunDetection(clip.scene, clip.maps, SmallConfig());
  CHECK(run.detection.count() == 0);
  CHECK(run.refined.empty());
  CHECK(VariancePicture(run.detection).dim() == 3);
  CHECK(TracksPicture(clip.scene, run.detection).dim() == 3);
}

TEST_CASE("local coordinates have unit range, zero mean and lead back to the tracks") {
  torch::manual_seed(1);
  const torch::Tensor tracks = torch::rand({101, 2, 3}) * torch::tensor({0.5, 2.0, 0.1}) + 3;
  const LocalCoordinates coordinates = ToLocalCoordinates(tracks);
  CHECK(coordinates.local.mean(0).abs().max().item<double>() < 1e-6);
  const torch::Tensor range = torch::quantile(coordinates.local, 0.9, 0) - torch::quantile(coordinates.local, 0.1, 0);
  CHECK(torch::allclose(std::get<0>(range.max(1)), torch::ones({2}, torch::kFloat64)));
  const torch::Tensor back = (coordinates.local - coordinates.offset) / coordinates.scale.view({1, -1, 1});
  CHECK(torch::allclose(back, tracks.to(torch::kFloat64)));
  CHECK(ToLocalCoordinates(torch::zeros({5, 1, 3})).scale[0].item<double>() == Approx(100));
  CHECK(ToLocalCoordinates(torch::zeros({5, 0, 3})).local.numel() == 0);
}
