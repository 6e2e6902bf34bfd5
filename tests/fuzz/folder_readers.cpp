#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/importers/colmap_model.h"
#include "libeditnerf/imaging/importers/llff.h"
#include "libeditnerf/imaging/importers/transforms_json.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/imaging/truth_files.h"
#include "tests/fuzz/readers.h"
#include "tests/fuzz/small_scene.h"
#include "tests/imaging/colmap_fixture.h"

namespace editnerf::fuzz {
namespace fs = std::filesystem;
namespace {

using Inputs = std::vector<std::string>;

// The files of one input inside a folder that belongs to the reader. A file that the input lacks is not there.
fs::path Unpack(const std::string& folder, const std::vector<std::string>& names, const std::string& input) {
  const auto contents = Split(input, names.size());
  for (size_t i = 0; i < names.size(); ++i) {
    const fs::path path = InputFile(folder + "/" + names[i], contents[i]);
    if (contents[i].empty()) fs::remove(path);
  }
  return InputFolder() / folder;
}

Inputs Pack(const fs::path& folder, const std::vector<std::string>& names) {
  std::vector<std::string> contents;
  for (const std::string& name : names) contents.push_back(FileContent(folder / name));
  return {Join(contents)};
}

const std::vector<std::string> kColmapBinary = {"cameras.bin", "images.bin", "points3D.bin"};
const std::vector<std::string> kColmapText = {"cameras.txt", "images.txt", "points3D.txt"};

ColmapFixture SmallModel() {
  ColmapFixture model = ArcFixture(2);
  model.points.resize(2);
  return model;
}

void ReadColmapBinaryInput(const std::string& input) {
  ReadColmapModel(Unpack("colmap_binary", kColmapBinary, input), "images");
}

Inputs ColmapBinarySeeds() {
  WriteColmapBinary(SmallModel(), InputFolder() / "seed");
  return Pack(InputFolder() / "seed", kColmapBinary);
}

void ReadColmapTextInput(const std::string& input) {
  ReadColmapModel(Unpack("colmap_text", kColmapText, input), "images");
}

Inputs ColmapTextSeeds() {
  WriteColmapText(SmallModel(), InputFolder() / "seed");
  return Pack(InputFolder() / "seed", kColmapText);
}

void ReadLlffInput(const std::string& input) {
  const fs::path file = InputFile("llff/poses_bounds.npy", input);
  for (const char* image : {"llff/images/a.png", "llff/images/b.png"}) InputFile(image, "");
  ReadLlffPoses(file, InputFolder() / "llff" / "images");
}

Inputs LlffSeeds() {
  const std::vector<double> row = {0, 1, 0, 0, 3, -1, 0, 0, 0, 4, 0, 0, 1, 0, 4, 1, 2};
  const fs::path path = InputFolder() / "seed.npy";
  WriteNpy(path, torch::tensor(row, torch::kFloat64).repeat({2, 1}));
  return {FileContent(path)};
}

void WriteImage(const fs::path& path) {
  fs::create_directories(path.parent_path());
  if (!fs::exists(path)) WritePng(path, torch::zeros({3, 4, 3}, torch::kUInt8));
}

void ReadTransformsInput(const std::string& input) {
  WriteImage(InputFolder() / "transforms" / "a.png");
  ReadTransformsJson(InputFile("transforms/transforms.json", input));
}

Inputs TransformsSeeds() {
  const Json matrix = {{1, 0, 0, 0}, {0, 0, -1, -4}, {0, 1, 0, 1}, {0, 0, 0, 1}};
  const Json frame = {{"file_path", "./a"}, {"time", 0.5}, {"transform_matrix", matrix}};
  Json second = frame;
  second["fl_x"] = 5, second["fl_y"] = 6, second["cx"] = 2, second["cy"] = 1.5, second["k1"] = 0.1, second["p2"] = 0;
  return {Json{{"camera_angle_x", 0.5}, {"frames", {frame}}}.dump(),
          Json{{"w", 4}, {"h", 3}, {"fl_x", 4}, {"frames", {frame, second}}}.dump()};
}

const std::vector<std::string> kKeyPoints = {"data/k_points_auto.txt", "data/k_points_auto_coor_0.txt",
                                             "data/k_points_auto_coor_1.txt"};

void ReadKeyPointsInput(const std::string& input) { ReadKeyPointFiles(Unpack("key_points", kKeyPoints, input)); }

Inputs KeyPointsSeeds() {
  const fs::path folder = InputFolder() / "seed";
  WriteKeyPointFiles(folder, {torch::rand({3, 2, 3}, torch::kFloat64), torch::ones({2}), torch::zeros({2, 3})});
  return Pack(folder, kKeyPoints);
}

const std::vector<std::string> kScene = {"scene.json",     "dataset.json",  "metadata.json", "camera/a.json",
                                         "gt/motion.json", "gt/edits.json", "points.npy"};

// Both frames have one camera and images of 4 x 3 pixels.
void ReadSceneInput(const std::string& input) {
  const fs::path folder = Unpack("scene", kScene, input);
  for (const char* name : {"rgb/1x/a.png", "rgb/1x/b.png"}) WriteImage(folder / name);
  if (fs::exists(folder / "camera" / "a.json")) {
    fs::copy_file(folder / "camera" / "a.json", folder / "camera" / "b.json", fs::copy_options::overwrite_existing);
  }
  DataConfig config;
  config.image_factor = 1;
  ReadSceneFolder(folder, config);
}

Inputs SceneSeeds() {
  Scene scene = SmallScene();
  for (SceneFrame& frame : scene.frames) frame.warp_id = frame.appearance_id = 0;
  scene.points = torch::zeros({1, 3});
  scene.truth = GroundTruth{{"lid"}, torch::eye(4, torch::kFloat64).expand({2, 1, 4, 4}), {}, {}};
  const fs::path folder = InputFolder() / "seed_scene";
  WriteSceneFolder(scene, folder);
  return Pack(folder, kScene);
}

void ReadImageInput(const std::string& input) {
  const fs::path path = InputFile("image.png", input);
  ReadImage(path);
}

void ReadMaskInput(const std::string& input) { ReadMask(InputFile("mask.png", input)); }

Inputs ImageSeeds() {
  const fs::path path = InputFolder() / "seed.png";
  WritePng(path, torch::zeros({3, 4, 3}, torch::kUInt8));
  return {FileContent(path)};
}

Inputs MaskSeeds() {
  const fs::path path = InputFolder() / "seed.png";
  WritePng(path, torch::zeros({3, 4}, torch::kUInt8));
  return {FileContent(path)};
}

}  // namespace

std::vector<Reader> FolderReaders() {
  return {{"colmap_binary", ReadColmapBinaryInput, ColmapBinarySeeds},
          {"colmap_text", ReadColmapTextInput, ColmapTextSeeds},
          {"llff", ReadLlffInput, LlffSeeds},
          {"transforms", ReadTransformsInput, TransformsSeeds},
          {"key_points", ReadKeyPointsInput, KeyPointsSeeds},
          {"scene", ReadSceneInput, SceneSeeds},
          {"image", ReadImageInput, ImageSeeds},
          {"mask", ReadMaskInput, MaskSeeds}};
}

}  // namespace editnerf::fuzz
