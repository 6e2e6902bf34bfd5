#include "libeditnerf/scene/packed_scene.h"

#include <torch/types.h>

#include <filesystem>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"
#include "tests/catch.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

struct TemporaryFile {
  TemporaryFile() {
    std::string folder = (fs::temp_directory_path() / "editnerf_packed_XXXXXX").string();
    REQUIRE(::mkdtemp(folder.data()) != nullptr);
    path = fs::path(folder) / "scene.safetensors";
  }
  ~TemporaryFile() { fs::remove_all(path.parent_path()); }
  fs::path path;
};

// Four frames of 6 x 4 pixels, two for training, with everything that a scene can have.
Scene FullScene() {
  Scene scene;
  scene.name = "full";
  scene.transform = {0.3, {1, -2, 0.1}, 0.05, 1.7};
  for (int64_t i = 0; i < 4; ++i) {
    SceneFrame frame;
    frame.id = "00" + std::to_string(i);
    frame.warp_id = i < 3 ? i : -1;
    frame.appearance_id = i < 3 ? 2 - i : -1;
    const double angle = 0.1 * static_cast<double>(i), c = std::cos(angle), s = std::sin(angle);
    frame.camera.orientation = {{c, 0, s, 0, 1, 0, -s, 0, c}};
    frame.camera.position = {0.1 * angle, -0.2, 1.0 / 3.0};
    frame.camera.focal_length = 5.1 + angle;
    frame.camera.principal_point = {3.1, 2.2};
    frame.camera.skew = 0.01;
    frame.camera.pixel_aspect_ratio = 1.01;
    frame.camera.radial_distortion = {0.1, -0.02, 0.003};
    frame.camera.tangential_distortion = {1e-3, -2e-3};
    frame.camera.width = 6;
    frame.camera.height = 4;
    scene.frames.push_back(frame);
  }
  scene.train = {0, 1};
  scene.val = {2};
  scene.edit = {3};
  scene.images = torch::randint(0, 256, {4, 4, 6, 3}, torch::kUInt8);
  scene.points = torch::rand({7, 3});
  GroundTruth truth;
  truth.objects = {"lid", "cup"};
  truth.scene_from_object = torch::rand({4, 2, 4, 4}, torch::kFloat64);
  truth.depth = torch::rand({4, 4, 6});
  truth.depth[0][0][0] = INFINITY;
  truth.mask = torch::randint(0, 3, {4, 4, 6}, torch::kUInt8);
  scene.truth = truth;
  return scene;
}

std::string LoadError(const fs::path& path) {
  try {
    LoadPackedScene(path);
  } catch (const DataError& error) {
    const std::string text = error.what(), prefix = path.string() + ": ";
    REQUIRE(text.rfind(prefix, 0) == 0);
    return text.substr(prefix.size());
  }
  return "no error";
}

}  // namespace

TEST_CASE("a packed scene keeps everything that a scene holds") {
  const TemporaryFile file;
  const Scene scene = FullScene();
  SavePackedScene(scene, file.path);
  const Scene read = LoadPackedScene(file.path);
  CHECK(read.name == scene.name);
  CHECK(read.transform.scale == scene.transform.scale);
  CHECK(read.transform.center.z == scene.transform.center.z);
  CHECK(read.transform.near == scene.transform.near);
  CHECK(read.transform.far == scene.transform.far);
  CHECK(read.train == scene.train);
  CHECK(read.val == scene.val);
  CHECK(read.edit == scene.edit);
  CHECK(torch::equal(read.images, scene.images));
  CHECK(torch::equal(read.points, scene.points));
  REQUIRE(read.frames.size() == scene.frames.size());
  for (size_t i = 0; i < scene.frames.size(); ++i) {
    const SceneFrame &a = read.frames[i], &b = scene.frames[i];
    CHECK(a.id == b.id);
    CHECK(a.warp_id == b.warp_id);
    CHECK(a.appearance_id == b.appearance_id);
    CHECK(a.camera.orientation.m == b.camera.orientation.m);
    CHECK(Norm(a.camera.position - b.camera.position) == 0);
    CHECK(a.camera.focal_length == b.camera.focal_length);
    CHECK(a.camera.principal_point == b.camera.principal_point);
    CHECK(a.camera.skew == b.camera.skew);
    CHECK(a.camera.pixel_aspect_ratio == b.camera.pixel_aspect_ratio);
    CHECK(a.camera.radial_distortion == b.camera.radial_distortion);
    CHECK(a.camera.tangential_distortion == b.camera.tangential_distortion);
    CHECK(a.camera.width == b.camera.width);
    CHECK(a.camera.height == b.camera.height);
  }
  REQUIRE(read.truth.has_value());
  CHECK(read.truth->objects == scene.truth->objects);
  CHECK(torch::equal(read.truth->scene_from_object, scene.truth->scene_from_object));
  CHECK(torch::equal(read.truth->depth, scene.truth->depth));
  CHECK(torch::equal(read.truth->mask, scene.truth->mask));
}

TEST_CASE("a packed scene needs neither points, truth, validation nor edit frames") {
  const TemporaryFile file;
  Scene scene = FullScene();
  scene.points = torch::Tensor();
  scene.truth.reset();
  scene.val.clear();
  scene.edit.clear();
  SavePackedScene(scene, file.path);
  const Scene read = LoadPackedScene(file.path);
  CHECK_FALSE(read.points.defined());
  CHECK_FALSE(read.truth.has_value());
  CHECK(read.val.empty());
  CHECK(read.edit.empty());
}

TEST_CASE("an inconsistent scene is not packed") {
  const TemporaryFile file;
  Scene scene = FullScene();
  scene.train = {0};
  CHECK_THROWS_AS(SavePackedScene(scene, file.path), DataError);
  CHECK_FALSE(fs::exists(file.path));
}

TEST_CASE("a damaged packed scene says what is wrong") {
  const TemporaryFile file;
  CHECK(LoadError(file.path) == "no such file");
  WriteSafetensors(file.path, {}, {{"format", "something"}});
  CHECK(LoadError(file.path) == "expected a packed scene (format 'editnerf-scene'), found format 'something'");
  SavePackedScene(FullScene(), file.path);
  const SafetensorsFile good = ReadSafetensors(file.path);
  const auto error_with = [&](const std::function<void(SafetensorsFile&)>& damage) {
    SafetensorsFile bad = good;
    damage(bad);
    WriteSafetensors(file.path, bad.tensors, bad.metadata);
    return LoadError(file.path);
  };
  CHECK(error_with([](SafetensorsFile& f) { f.metadata["version"] = "9"; }) ==
        "expected version 1 of the packed scene, found '9'");
  CHECK(error_with([](SafetensorsFile& f) { f.metadata["scene"] = "{}"; }).find("metadata 'scene' is damaged: ") == 0);
  CHECK(error_with([](SafetensorsFile& f) { f.tensors.erase("images"); }) == "tensor 'images' is missing");
  CHECK(error_with([](SafetensorsFile& f) {
          f.tensors["images"] = torch::zeros({4, 4, 6, 3});
        }) == "tensor 'images': expected Byte, found Float");
  CHECK(error_with([](SafetensorsFile& f) {
          f.tensors["points"] = torch::zeros({4, 2});
        }) == "points: expected shape [*, 3], found [4, 2]");
  CHECK(error_with([](SafetensorsFile& f) { f.tensors["split.val"] = torch::tensor({9}, torch::kInt64); }) ==
        "full: a split names frame 9 of 4");
  CHECK(error_with([](SafetensorsFile& f) { f.tensors["camera.intrinsics"][0][0] = NAN; }).find("full: camera 000") ==
        0);
}

}  // namespace editnerf
