#include "libeditnerf/pipeline/evaluate_run.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/evaluation/image_metrics.h"
#include "libeditnerf/pipeline/key_point_scores.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr int64_t kSide = 12;

// A plate in front of the camera that moves along x: training at times 0, 2 and 4, validation at 2 (with the image of
// the training frame) and 3, an edit frame at 1.
Scene MakeScene() {
  Scene scene;
  scene.name = "plate";
  scene.transform.near = 0.5;
  scene.transform.far = 2;
  Camera camera;
  camera.focal_length = kSide;
  camera.principal_point = {kSide / 2.0, kSide / 2.0};
  camera.width = camera.height = kSide;
  const std::vector<double> times = {0, 2, 4, 2, 3, 1};
  const auto count = static_cast<int64_t>(times.size());
  for (int64_t f = 0; f < count; ++f) {
    const int64_t id = f == 5 ? -1 : static_cast<int64_t>(times[static_cast<size_t>(f)]);
    scene.frames.push_back({std::to_string(f), id, id, camera});
  }
  scene.train = {0, 1, 2};
  scene.val = {3, 4};
  scene.edit = {5};
  scene.images =
      torch::arange(count * kSide * kSide * 3).remainder(251).to(torch::kUInt8).view({count, kSide, kSide, 3});
  scene.images[3].copy_(scene.images[1]);
  GroundTruth truth;
  truth.objects = {"plate"};
  truth.scene_from_object = torch::eye(4, torch::kFloat64).repeat({count, 1, 1, 1});
  for (int64_t f = 0; f < count; ++f) truth.scene_from_object[f][0][0][3] = 0.05 * times[static_cast<size_t>(f)];
  truth.depth = torch::ones({count, kSide, kSide});
  truth.mask = torch::zeros({count, kSide, kSide}, torch::kUInt8);
  truth.mask.slice(2, kSide / 2).fill_(1);
  scene.truth = truth;
  return scene;
}

// On the plate in every training frame.
torch::Tensor Tracks() {
  return torch::tensor({0.0, 0.0, 1.0, 0.1, 0.0, 1.0, 0.2, 0.0, 1.0}, torch::kFloat32).view({3, 1, 3}) +
         torch::tensor({0.05, 0.05, 0.0}, torch::kFloat32);
}

Run UntrainedRun(const Scene& scene, FieldStage stage) {
  const std::string tiny = std::string(EDITNERF_SOURCE_DIR) + "/configs/tiny.yaml";
  Run run =
      MakeRun(LoadConfig(tiny), stage, scene, stage == FieldStage::kTrain ? Tracks() : torch::Tensor(), torch::kCPU);
  run.counters.seconds_total = 3;
  run.counters.seconds_training = 2;
  return run;
}

}  // namespace

TEST_CASE("a run is measured by all protocols and against the nearest training image") {
  const Scene scene = MakeScene();
  Run run = UntrainedRun(scene, FieldStage::kTrain);
  EvaluationRequest request;
  request.protocols = {"reconstruction", "interpolation", "editing"};
  const nlohmann::json json = ToJson(EvaluateRun(run, scene, request));
  for (const char* protocol : {"reconstruction", "interpolation", "editing"}) {
    INFO(protocol);
    CHECK(json.at(std::string(protocol) + ".frames") == 1);
    CHECK(json.contains(std::string(protocol) + ".psnr_moving"));
  }
  CHECK(json.at("reconstruction_nearest.psnr") == kMaxPsnr);
  CHECK(json.at("editing_nearest.frames") == 1);
  CHECK(json.at("editing.key_point_distance").get<double>() == Approx(0.05).epsilon(1e-4));
  CHECK(json.at("frames").at("editing").at(0).at("id") == "5");
  CHECK(json.at("key_points.count") == 1);
  CHECK(json.at("seconds.train") == 3);
  CHECK(json.at("seconds.train_only") == 2);
}

TEST_CASE("key points that follow the true motion have no error") {
  const Scene scene = MakeScene();
  Run run = UntrainedRun(scene, FieldStage::kTrain);
  const nlohmann::json json = ToJson(MeasureKeyPoints(run, scene, ""));
  CHECK(json.at("key_points.on_moving_part") == 1);
  CHECK(json.at("key_points.objects") == nlohmann::json{"plate"});
  CHECK(json.at("key_points.error").get<double>() < 1e-5);
  CHECK(json.at("key_points.error_share").get<double>() < 1e-4);
}

TEST_CASE("a pretrained run is measured but not edited") {
  const Scene scene = MakeScene();
  Run run = UntrainedRun(scene, FieldStage::kPretrain);
  EvaluationRequest request;
  request.protocols = {"editing"};
  CHECK_THROWS_WITH(EvaluateRun(run, scene, request), HasText("a pretrained run has no key points"));
  CHECK(ReasonAgainst(run, scene, "reconstruction").empty());
  CHECK(MeasureKeyPoints(run, scene, "").empty());
}

TEST_CASE("what a scene cannot be measured by is said") {
  Scene scene = MakeScene();
  const Run run = UntrainedRun(scene, FieldStage::kTrain);
  CHECK_THROWS_AS(ReasonAgainst(run, scene, "edit"), ConfigError);
  scene.edit.clear();
  CHECK_THAT(ReasonAgainst(run, scene, "editing"), HasText("no edit frames"));
  scene.truth.reset();
  CHECK_THAT(ReasonAgainst(run, scene, "editing"), HasText("no ground truth"));
  scene.val.clear();
  CHECK_THAT(ReasonAgainst(run, scene, "interpolation"), HasText("no held-out frames"));
}

TEST_CASE("another scene than the run's is refused") {
  Scene scene = MakeScene();
  Run run = UntrainedRun(scene, FieldStage::kTrain);
  EvaluationRequest request;
  request.protocols = {"reconstruction"};
  scene.train.pop_back();
  CHECK_THROWS_WITH(EvaluateRun(run, scene, request), HasText("training frames differ"));
}
