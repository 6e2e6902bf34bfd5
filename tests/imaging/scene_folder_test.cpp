#include "libeditnerf/imaging/scene_folder.h"

#include <cmath>
#include <functional>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/imaging/scene_images.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"
#include "tests/shared_data.h"

using namespace editnerf;

namespace {

Mat3 RotationAboutY(double angle) {
  return {{std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle)}};
}

// `num_train` training frames, then one validation frame and one edit frame where `extras`.
Scene SmallScene(int64_t num_train, bool extras) {
  Scene scene;
  scene.name = "small";
  scene.transform.scale = 0.3;
  scene.transform.center = {1, -2, 0.5};
  scene.transform.near = 0.2;
  scene.transform.far = 3;
  const int64_t count = num_train + (extras ? 2 : 0), height = 6, width = 8;
  for (int64_t i = 0; i < count; ++i) {
    SceneFrame frame;
    frame.id = "frame" + std::to_string(100 + i);
    const bool edit = extras && i == count - 1;
    frame.warp_id = edit ? -1 : i < num_train ? i : 1;
    frame.appearance_id = frame.warp_id;
    frame.camera.orientation = RotationAboutY(0.1 * static_cast<double>(i));
    frame.camera.position = {0.1 * static_cast<double>(i), 0.2, -1.0 / 3};
    frame.camera.focal_length = 10.1 + static_cast<double>(i);
    frame.camera.principal_point = {4.25, 2.75};
    frame.camera.skew = 0.01;
    frame.camera.pixel_aspect_ratio = 1.02;
    frame.camera.radial_distortion = {0.1, -0.02, 0.003};
    frame.camera.tangential_distortion = {0.001, -0.002};
    frame.camera.width = width;
    frame.camera.height = height;
    scene.frames.push_back(frame);
    (i < num_train ? scene.train : edit ? scene.edit : scene.val).push_back(i);
  }
  scene.images = torch::randint(0, 256, {count, height, width, 3}, torch::kUInt8);
  scene.points = torch::rand({5, 3});
  if (!extras) return scene;
  GroundTruth truth;
  truth.objects = {"lid", "key"};
  truth.scene_from_object = torch::eye(4, torch::kFloat64).repeat({count, 2, 1, 1});
  for (int64_t i = 0; i < count; ++i) {
    const Mat3 rotation = RotationAboutY(0.2 * static_cast<double>(i));
    for (int64_t e = 0; e < 9; ++e) truth.scene_from_object[i][1][e / 3][e % 3] = rotation.m[static_cast<size_t>(e)];
    truth.scene_from_object[i][1][0][3] = 0.1 * static_cast<double>(i);
  }
  truth.depth = torch::rand({count, height, width}) + 0.5;
  truth.depth[0][0][0] = std::numeric_limits<float>::infinity();
  truth.mask = torch::randint(0, 3, {count, height, width}, torch::kUInt8);
  scene.truth = truth;
  return scene;
}

DataConfig FullSize() {
  DataConfig config;
  config.image_factor = 1;
  return config;
}

// The DataError after `damage` was done to a good folder; it must start with the folder's path.
std::string ErrorAfter(const std::function<void(const std::filesystem::path&)>& damage) {
  const ScratchFolder folder;
  WriteSceneFolder(SmallScene(4, true), folder.path());
  damage(folder.path());
  const std::string message = MessageOf<DataError>([&] { ReadSceneFolder(folder.path(), FullSize()); });
  INFO(message);
  REQUIRE(message.find(folder.path().string()) == 0);
  return message.substr(folder.path().string().size() + 1);
}

// Changes one JSON file by `change`.
std::string ErrorAfterChange(const std::string& file, const std::function<void(Json&)>& change) {
  return ErrorAfter([&](const std::filesystem::path& folder) {
    Json json = ReadJson(folder / file);
    change(json);
    WriteText(folder / file, json.dump());
  });
}

}  // namespace

TEST_CASE("a scene folder that was written reads back the same") {
  const ScratchFolder folder;
  const Scene written = SmallScene(4, true);
  WriteSceneFolder(written, folder.path());
  const Scene read = ReadSceneFolder(folder.path(), FullSize());
  CHECK(read.name == folder.path().filename().string());
  CHECK(read.transform.scale == written.transform.scale);
  CHECK(read.transform.near == written.transform.near);
  CHECK(read.transform.far == written.transform.far);
  CHECK(Norm(read.transform.center - written.transform.center) == 0);
  CHECK(read.train == written.train);
  CHECK(read.val == written.val);
  CHECK(read.edit == written.edit);
  REQUIRE(read.frames.size() == written.frames.size());
  for (size_t i = 0; i < read.frames.size(); ++i) {
    const SceneFrame &a = read.frames[i], &b = written.frames[i];
    CHECK(a.id == b.id);
    CHECK(a.warp_id == b.warp_id);
    CHECK(a.appearance_id == b.appearance_id);
    CHECK(Norm(a.camera.position - b.camera.position) < 1e-9);
    CHECK(a.camera.orientation.m == b.camera.orientation.m);
    CHECK(a.camera.focal_length == b.camera.focal_length);
    CHECK(a.camera.principal_point == b.camera.principal_point);
    CHECK(a.camera.skew == b.camera.skew);
    CHECK(a.camera.pixel_aspect_ratio == b.camera.pixel_aspect_ratio);
    CHECK(a.camera.radial_distortion == b.camera.radial_distortion);
    CHECK(a.camera.tangential_distortion == b.camera.tangential_distortion);
  }
  CHECK(torch::equal(read.images, written.images));
  CHECK(torch::allclose(read.points, written.points, 1e-5, 1e-6));
  REQUIRE(read.truth);
  CHECK(read.truth->objects == written.truth->objects);
  CHECK(torch::allclose(read.truth->scene_from_object, written.truth->scene_from_object, 0, 1e-9));
  CHECK(torch::allclose(read.truth->depth, written.truth->depth, 1e-6, 0));
  CHECK(torch::equal(read.truth->mask, written.truth->mask));
}

TEST_CASE("a world ten thousand times as large, or as small, is the same scene") {
  const double size = GENERATE(1e-4, 1e4);
  INFO("size " << size);
  const ScratchFolder folder;
  const Scene scene = SmallScene(4, true);
  Scene scaled = scene;
  scaled.transform.scale = scene.transform.scale / size;
  scaled.transform.center = scene.transform.center * size;
  WriteSceneFolder(scaled, folder.path());
  const Vec3 stored = ReadCameraFile(folder.path() / "camera" / "frame101.json").position;
  const Vec3 in_scene = scene.frames[1].camera.position;
  CHECK(Norm(stored - (in_scene / scene.transform.scale + scene.transform.center) * size) < 1e-9 * size);
  const Scene read = ReadSceneFolder(folder.path(), FullSize());
  for (size_t i = 0; i < read.frames.size(); ++i) {
    CHECK(Norm(read.frames[i].camera.position - scene.frames[i].camera.position) < 1e-9);
  }
  CHECK(torch::allclose(read.points, scene.points, 1e-5, 1e-5));
  CHECK(torch::allclose(read.truth->scene_from_object, scene.truth->scene_from_object, 0, 1e-9));
  CHECK(torch::allclose(read.truth->depth, scene.truth->depth, 1e-6, 0));
}

TEST_CASE("a scene that replaces another leaves nothing of it that would be read") {
  const ScratchFolder folder;
  WriteSceneFolder(SmallScene(4, true), folder.path());
  WriteText(folder.path() / "rgb" / "2x" / "frame100.png", "stale");
  Scene second = SmallScene(3, false);
  second.points = torch::Tensor();
  WriteSceneFolder(second, folder.path());
  const Scene read = ReadSceneFolder(folder.path(), FullSize());
  CHECK(read.frames.size() == 3);
  CHECK_FALSE(read.truth);
  CHECK_FALSE(read.points.defined());
  CHECK_FALSE(std::filesystem::exists(folder.path() / "rgb" / "2x"));
}

TEST_CASE("cameras, images and truth shrink together") {
  const ScratchFolder folder;
  const Scene written = SmallScene(2, true);
  WriteSceneFolder(written, folder.path());
  DataConfig config;
  config.image_factor = 2;
  const Scene read = ReadSceneFolder(folder.path(), config);
  CHECK(read.width() == 4);
  CHECK(read.height() == 3);
  CHECK(std::abs(read.frames[0].camera.focal_length - written.frames[0].camera.focal_length / 2) < 1e-12);
  CHECK(read.frames[0].camera.principal_point[1] == 2.75 / 2);
  const torch::Tensor mean =
      written.images[1].slice(0, 2, 4).slice(1, 4, 6).to(torch::kFloat64).mean(std::vector<int64_t>{0, 1});
  CHECK(torch::allclose(read.images[1][1][2].to(torch::kFloat64), mean, 0, 0.51));
  CHECK(torch::equal(read.truth->mask, written.truth->mask.slice(1, 1, 6, 2).slice(2, 1, 8, 2)));

  // A picture at the right size in rgb/2x is taken as it is; one of another size is not.
  const torch::Tensor own = torch::full({3, 4, 3}, 77, torch::kUInt8);
  std::filesystem::create_directories(folder.path() / "rgb" / "2x");
  WritePng(folder.path() / "rgb" / "2x" / "frame100.png", own);
  WritePng(folder.path() / "rgb" / "2x" / "frame101.png", own.slice(0, 0, 2));
  const Scene again = ReadSceneFolder(folder.path(), config);
  CHECK(torch::equal(again.images[0], own));
  CHECK(torch::equal(again.images[1], read.images[1]));
}

TEST_CASE("the automatic factor is the smallest that respects max_side") {
  DataConfig config;
  config.max_side = 320;
  CHECK(ImageFactor(config, 320, 180) == 1);
  CHECK(ImageFactor(config, 321, 180) == 2);
  CHECK(ImageFactor(config, 384, 512) == 2);
  CHECK(ImageFactor(config, 1920, 1080) == 6);
  config.image_factor = 4;
  CHECK(ImageFactor(config, 320, 180) == 4);
}

TEST_CASE("every second or eighth frame is held out where the folder names no validation frames") {
  const ScratchFolder folder;
  const auto read = [&](int64_t frames, const std::string& hold_out) {
    WriteSceneFolder(SmallScene(frames, false), folder.path());
    DataConfig config = FullSize();
    config.hold_out = hold_out;
    return ReadSceneFolder(folder.path(), config);
  };
  const Scene odd = read(5, "odd");
  CHECK(odd.train == std::vector<int64_t>{0, 2, 4});
  CHECK(odd.val == std::vector<int64_t>{1, 3});
  CHECK(odd.frames[3].warp_id == 3);
  CHECK(read(15, "auto").val.empty());
  CHECK(read(16, "auto").val == std::vector<int64_t>{4, 12});
  CHECK(read(6, "eighth").val == std::vector<int64_t>{4});
  CHECK(read(16, "none").val.empty());
  CHECK_THAT(MessageOf<ConfigError>([&] { read(2, "odd"); }), HasText("'odd' leaves 1 of 2 training frames"));
}

TEST_CASE("the training order is that of train_ids, and frames outside every split are left out") {
  const ScratchFolder folder;
  WriteSceneFolder(SmallScene(4, false), folder.path());
  Json dataset = ReadJson(folder.path() / "dataset.json");
  dataset["train_ids"] = {"frame103", "frame100", "frame102"};
  WriteText(folder.path() / "dataset.json", dataset.dump());
  const Scene scene = ReadSceneFolder(folder.path(), FullSize());
  CHECK(scene.frames.size() == 3);
  CHECK(scene.frames[static_cast<size_t>(scene.train[0])].id == "frame103");
  CHECK(scene.frames[static_cast<size_t>(scene.train[1])].id == "frame100");
}

TEST_CASE("the older spelling of the tangential distortion is read") {
  const ScratchFolder folder;
  Json json = CameraToJson(SmallScene(2, false).frames[0].camera);
  json["tangential"] = json["tangential_distortion"];
  json.erase("tangential_distortion");
  WriteText(folder.path() / "camera.json", json.dump());
  CHECK(ReadCameraFile(folder.path() / "camera.json").tangential_distortion[1] == -0.002);
}

TEST_CASE("motions are conjugated into scene units, rotations unscaled") {
  const Scene scene = SmallScene(2, true);
  const ScratchFolder folder;
  WriteSceneFolder(scene, folder.path());
  const Json motion = ReadJson(folder.path() / "gt" / "motion.json");
  const auto m = JsonMatrix(motion["frames"]["frame101"]["key"], 4, 4, "motion");
  const Vec3 world = {0.3, 0.7, -0.2};
  const Vec3 moved = {m[0] * world.x + m[1] * world.y + m[2] * world.z + m[3],
                      m[4] * world.x + m[5] * world.y + m[6] * world.z + m[7],
                      m[8] * world.x + m[9] * world.y + m[10] * world.z + m[11]};
  const SceneTransform& s = scene.transform;
  const Vec3 in_scene = (world - s.center) * s.scale;
  const torch::Tensor expected = scene.truth->scene_from_object[1][1].matmul(
      torch::tensor({in_scene.x, in_scene.y, in_scene.z, 1.0}, torch::kFloat64));
  const Vec3 found = (moved - s.center) * s.scale;
  CHECK(std::abs(found.x - expected[0].item<double>()) < 1e-12);
  CHECK(std::abs(found.y - expected[1].item<double>()) < 1e-12);
  CHECK(std::abs(found.z - expected[2].item<double>()) < 1e-12);
}

TEST_CASE("a damaged scene folder is refused with the file and what was expected") {
  using std::filesystem::path;
  const auto remove = [](const std::string& file) {
    return ErrorAfter([&](const path& folder) { std::filesystem::remove(folder / file); });
  };
  const std::string camera = "camera/frame102.json";
  CHECK_THAT(remove("rgb/1x/frame102.png"), StartsWithText("rgb/1x/frame102.png: no such image"));
  CHECK(remove(camera) == camera + ": no such file");
  CHECK(remove("metadata.json") == "metadata.json: no such file");
  CHECK(remove("scene.json") == "scene.json: no such file");
  CHECK(remove("dataset.json") == "dataset.json: no such file");
  CHECK_THAT(remove("gt/depth/frame102.npy"), StartsWithText("gt/depth/frame102.npy: no such file"));
  CHECK_THAT(remove("gt/mask/frame102.png"), StartsWithText("gt/mask/frame102.png: no such file"));
  CHECK_THAT(ErrorAfter([](const path& folder) { WriteText(folder / "rgb/1x/frame101.png", "broken"); }),
             StartsWithText("rgb/1x/frame101.png: cannot be decoded as an image"));
  CHECK_THAT(ErrorAfter([](const path& folder) {
               WritePng(folder / "rgb/1x/frame101.png", torch::zeros({5, 8, 3}, torch::kUInt8));
             }),
             StartsWithText("rgb/1x/frame101.png: 8 x 5 pixels, expected 8 x 6"));
  CHECK_THAT(ErrorAfter([](const path& folder) {
               WriteNpy(folder / "gt/depth/frame101.npy", torch::ones({6, 9}));
             }),
             HasText("depth of frame 'frame101' has 9 x 6 pixels, which does not fit images of 8 x 6"));

  CHECK(ErrorAfterChange(camera, [](Json& json) { json.erase("focal_length"); }) ==
        camera + ": 'focal_length' is missing");
  CHECK(ErrorAfterChange(camera, [](Json& json) { json.erase("tangential_distortion"); }) ==
        camera + ": 'tangential_distortion' is missing");
  CHECK(ErrorAfterChange(camera, [](Json& json) { json["position"][1] = nullptr; }) ==
        camera + ": position: expected a number, found null");
  CHECK(ErrorAfterChange(camera, [](Json& json) {
          json["position"] = {1, 2};
        }) == camera + ": position: expected 3 numbers, found [1,2]");
  CHECK(ErrorAfterChange(camera, [](Json& json) { json["focal_length"] = -1; }) ==
        camera + ": focal_length: expected a positive number, found -1");
  CHECK_THAT(ErrorAfterChange(camera, [](Json& json) { json["orientation"][0][0] = 2; }),
             StartsWithText(camera + ": orientation: expected a rotation matrix"));
  CHECK_THAT(ErrorAfterChange(camera,
                              [](Json& json) {
                                json["image_size"] = {9, 6};
                              }),
             StartsWithText(camera + ": image_size: 9 x 6, expected 8 x 6 as in camera/frame100.json"));
  CHECK_THAT(ErrorAfter([&](const path& folder) {
               std::string text = ReadText(folder / camera);
               const size_t at = text.find("\"focal_length\": ") + 16;
               WriteText(folder / camera, text.substr(0, at) + "NaN" + text.substr(text.find(',', at)));
             }),
             StartsWithText(camera + ": expected JSON: parse error at line 2"));
  CHECK_THAT(ErrorAfter([&](const path& folder) { WriteText(folder / camera, "{\"orientation\": [1e999]}"); }),
             StartsWithText(camera + ": expected JSON: number overflow"));

  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["train_ids"].push_back("ghost"); }) ==
        "dataset.json: train_ids: 'ghost' is not in 'ids' of dataset.json");
  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["ids"].push_back("frame100"); }) ==
        "dataset.json: ids: 'frame100' is listed twice");
  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["count"] = 99; }) ==
        "dataset.json: 'count' is 99, but 'ids' lists 6 frames");
  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["val_ids"].push_back("frame100"); }) ==
        "dataset.json: 'frame100' is in both 'train_ids' and 'val_ids'");
  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["ids"][0] = "../../etc"; }) ==
        "dataset.json: ids: '../../etc' cannot be the name of a frame");
  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["train_ids"] = {"frame100"}; }) ==
        "dataset.json: expected at least two training frames, found 1; one view alone does not determine a scene");
  CHECK(ErrorAfterChange("dataset.json", [](Json& json) { json["ids"] = 5; }) ==
        "dataset.json: ids: expected a list of names, found 5");
  CHECK_THAT(ErrorAfterChange("gt/edits.json", [](Json& json) { json["ids"].push_back("frame101"); }),
             StartsWithText("gt/edits.json: 'frame101' is an edit frame, but dataset.json has it"));
  CHECK(ErrorAfterChange("metadata.json", [](Json& json) { json.erase("frame102"); }) ==
        "metadata.json: no entry for frame 'frame102'; every training and validation frame needs one");
  CHECK(ErrorAfterChange("metadata.json", [](Json& json) { json["frame102"]["warp_id"] = -3; }) ==
        "metadata.json: frame102: warp_id: expected 0 to 1000000, found -3");
  CHECK(ErrorAfterChange("scene.json", [](Json& json) { json["near"] = 3; }) ==
        "scene.json: expected 0 < near < far, found near 3 and far 3");
  CHECK(ErrorAfterChange("scene.json", [](Json& json) { json["scale"] = 0; }) ==
        "scene.json: scale: expected a positive number, found 0");
  CHECK(ErrorAfterChange("gt/motion.json", [](Json& json) { json["frames"].erase("frame102"); }) ==
        "gt/motion.json: frames: 'frame102' is missing");
  CHECK_THAT(ErrorAfterChange("gt/motion.json", [](Json& json) { json["frames"]["frame102"]["key"][0][0] = 5; }),
             StartsWithText("gt/motion.json: frame frame102: key: expected a rigid motion"));
  const ScratchFolder empty;
  CHECK_THAT(MessageOf<DataError>([&] { ReadSceneFolder(empty / "none", {}); }),
             HasText("no such folder; expected a scene folder"));
}

TEST_CASE("the synthetic lid sequence loads with its ground truth") {
  const auto shared = SharedData();
  if (!shared) {
    WARN("skipped: the shared data is not here");
    return;
  }
  const Scene scene = ReadSceneFolder(*shared / "data" / "lid", {});
  CHECK(scene.name == "lid");
  CHECK(scene.frames.size() == 200);
  CHECK(scene.train.size() == 160);
  CHECK(scene.val.size() == 16);
  CHECK(scene.edit.size() == 24);
  CHECK(scene.width() == 320);
  CHECK(scene.frames[160].warp_id == 4);
  REQUIRE(scene.truth);
  CHECK(scene.truth->objects == std::vector<std::string>{"lid"});
  CHECK(scene.truth->mask.max().item<int>() == 1);
  // Surfaces lie between near and far wherever something is hit.
  const torch::Tensor hit = scene.truth->depth.index({scene.truth->depth.isfinite()});
  CHECK(hit.min().item<double>() > scene.transform.near);
  CHECK(hit.max().item<double>() < scene.transform.far);
}
