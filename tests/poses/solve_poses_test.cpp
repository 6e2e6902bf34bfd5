#include "libeditnerf/poses/solve_poses.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/imaging/video_file.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/poses/fake_colmap.h"

using namespace editnerf;

namespace {

constexpr const char* kKnown = "database_path image_path output_path match_list_path";

void WriteImages(const std::filesystem::path& folder, int64_t count, int64_t height = 30, int64_t width = 40) {
  std::filesystem::create_directories(folder);
  for (int64_t i = 0; i < count; ++i) {
    const std::string name = "shot" + std::to_string(100 + i) + ".png";
    WritePng(folder / name, torch::full({height, width, 3}, 10 * i, torch::kUInt8));
  }
}

DataConfig FullSize() {
  DataConfig config;
  config.image_factor = 1;
  return config;
}

// Distance between where a sparse point is in the image by the scene and by the fixture, in pixels.
double ReprojectionDifference(const Scene& scene, const ColmapFixture& fixture) {
  double largest = 0;
  for (const SceneFrame& frame : scene.frames) {
    const auto index = static_cast<size_t>(std::stoi(frame.id));
    for (const Vec3& point : fixture.points) {
      const Vec3 in_scene = (point - scene.transform.center) * scene.transform.scale;
      const Projected found = Project(frame.camera, in_scene), expected = Project(fixture.cameras[index], point);
      largest = std::max(largest, std::abs(found.u - expected.u) + std::abs(found.v - expected.v));
    }
  }
  return largest;
}

}  // namespace

TEST_CASE("images become a scene folder, without the frames that COLMAP could not place") {
  const ScratchFolder folder;
  WriteImages(folder / "images", 8);
  ColmapFixture fixture = ArcFixture(8);
  ColmapFixture registered = fixture;
  registered.names.erase(registered.names.begin() + 3, registered.names.begin() + 5);
  registered.cameras.erase(registered.cameras.begin() + 3, registered.cameras.begin() + 5);
  WriteColmapBinary(registered, folder.path() / "models" / "0");
  SolvePosesOptions options;
  options.colmap.program = WriteFakeColmap(folder.path(), kKnown);
  const PosesReport report = SolvePoses(folder / "images", folder / "scene", options);
  CHECK(report.registered == 6);
  CHECK(report.total == 8);
  CHECK(report.missing == std::vector<std::string>{"000003", "000004"});
  CHECK(report.mean_reprojection_error == 0.5);
  CHECK(report.num_points == 40);

  const Scene scene = ReadSceneFolder(folder / "scene", FullSize());
  CHECK(scene.frames.size() == 6);
  CHECK(scene.frames[3].id == "000005");
  CHECK(scene.frames[3].warp_id == 3);
  CHECK(scene.images[3].max().item<int>() == 50);
  CHECK(scene.points.size(0) == 40);
  CHECK(scene.frames[0].camera.radial_distortion[0] == 0.01);
  CHECK(ReprojectionDifference(scene, fixture) < 1e-9);
  const Json json = ReadJson(folder.path() / "scene" / "poses_report.json");
  CHECK(json["registered_frames"] == 6);
  CHECK(json["total_frames"] == 8);
  CHECK(json["mean_reprojection_error_px"] == 0.5);
  CHECK(json["missing"] == Json({"000003", "000004"}));
  for (const char* stage : {"frames", "features", "matching", "mapping", "scene"}) {
    CHECK(json["seconds"].contains(stage));
  }

  CHECK_THAT(MessageOf<ConfigError>([&] { SolvePoses(folder / "images", folder / "scene", options); }),
             HasText("holds a scene already; --force replaces it"));
  options.force = true;
  CHECK(SolvePoses(folder / "images", folder / "scene", options).registered == 6);
}

TEST_CASE("too few registered frames are an error with advice, and no scene is left") {
  const ScratchFolder folder;
  WriteImages(folder / "images", 8);
  SolvePosesOptions options;
  options.colmap.program = WriteFakeColmap(folder.path(), kKnown);
  const auto error = [&] {
    return MessageOf<DataError>([&] { SolvePoses(folder / "images", folder / "scene", options); });
  };
  CHECK_THAT(error(),
             StartsWithText("COLMAP registered only 0 of 8 frames, expected at least 50 %: the camera must move"));
  WriteColmapBinary(ArcFixture(3), folder.path() / "models" / "0");
  CHECK_THAT(error(), StartsWithText("COLMAP registered only 3 of 8 frames, expected at least 50 %"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "scene" / "dataset.json"));
}

TEST_CASE("input that cannot be solved is refused") {
  const ScratchFolder folder;
  SolvePosesOptions options;
  options.colmap.program = "editnerf-no-such-colmap";
  const auto error = [&](const std::string& input) {
    return MessageOf<Error>([&] { SolvePoses(folder / input, folder / "scene", options); });
  };
  CHECK_THAT(error("none"), HasText("none: no such file or folder"));
  std::filesystem::create_directories(folder / "empty");
  CHECK_THAT(error("empty"),
             HasText("empty: expected a video or a folder of images (.png, .jpg, ...), found no image"));
  WriteImages(folder / "one", 1);
  CHECK_THAT(error("one"), HasText("one: expected at least two frames, found 1"));
  WriteImages(folder / "mixed", 3);
  WritePng(folder / "mixed" / "shot102.png", torch::zeros({31, 40, 3}, torch::kUInt8));
  CHECK_THAT(error("mixed"), HasText("shot102.png: 40 x 31 pixels, expected 40 x 30 as in shot100.png"));
  WriteImages(folder / "good", 3);
  CHECK_THAT(error("good"), HasText("install it (apt-get install colmap)"));
  WriteText(folder / "video.mp4", "no video");
  CHECK_THAT(error("video.mp4"), HasText("video.mp4: cannot be opened as a video"));
  WriteText(folder / "done/dataset.json", "{}");
  CHECK_THAT(error("done"), HasText("is a scene folder already"));
}

TEST_CASE("frames of a video are taken evenly") {
  const ScratchFolder folder;
  VideoWriter writer(folder / "clip.mp4", 40, 30, 25);
  for (int i = 0; i < 10; ++i) writer.Write(torch::full({30, 40, 3}, 20 * i, torch::kUInt8));
  writer.Finish();
  WriteColmapBinary(ArcFixture(5), folder.path() / "models" / "0");
  SolvePosesOptions options;
  options.max_frames = 5;
  options.colmap.program = WriteFakeColmap(folder.path(), kKnown);
  CHECK(SolvePoses(folder / "clip.mp4", folder / "scene", options).total == 5);
  const Scene scene = ReadSceneFolder(folder / "scene", FullSize());
  for (int64_t i = 0; i < 5; ++i) CHECK(std::abs(scene.images[i][15][20][1].item<int>() - 40 * i) < 8);
}

TEST_CASE("a solved COLMAP model is converted without COLMAP") {
  const ScratchFolder folder;
  WriteImages(folder / "images", 5);
  ColmapFixture fixture = ArcFixture(5);
  for (int i = 0; i < 5; ++i) fixture.names[static_cast<size_t>(i)] = "shot" + std::to_string(100 + i) + ".png";
  WriteColmapText(fixture, folder / "model");
  SolvePosesOptions options;
  options.colmap_model = folder / "model";
  options.colmap.program = "editnerf-no-such-colmap";
  options.max_frames = 3;  // does not thin out what is solved already
  CHECK(SolvePoses(folder / "images", folder / "scene", options).registered == 5);
  CHECK(ReprojectionDifference(ReadSceneFolder(folder / "scene", FullSize()), fixture) < 1e-9);
}

TEST_CASE("transforms.json and LLFF data sets are converted") {
  const ScratchFolder folder;
  WriteImages(folder / "nerf", 3);
  Json frames = Json::array();
  for (int i = 0; i < 3; ++i) {
    const double angle = 0.2 * i, c = std::cos(angle), s = std::sin(angle);
    // On a circle of radius 4 around the origin, looking at it.
    frames.push_back({{"file_path", "./shot10" + std::to_string(i)},
                      {"time", 1.0 - 0.1 * i},
                      {"transform_matrix", {{c, 0, s, 4 * s}, {0, 1, 0, 0}, {-s, 0, c, 4 * c}, {0, 0, 0, 1}}}});
  }
  WriteText(folder / "nerf/transforms_train.json", Json({{"camera_angle_x", 0.8}, {"frames", frames}}).dump());
  CHECK(SolvePoses(folder / "nerf", folder / "scene", {}).source == "transforms.json");
  const Scene scene = ReadSceneFolder(folder / "scene", FullSize());
  CHECK(scene.images[0].max().item<int>() == 20);  // the last file has the first time
  const Vec3 origin = (Vec3{} - scene.transform.center) * scene.transform.scale;
  for (const SceneFrame& frame : scene.frames) {
    const Projected projected = Project(frame.camera, origin);
    CHECK(std::abs(projected.u - 20) < 1e-9);
    CHECK(std::abs(projected.depth - 4 * scene.transform.scale) < 1e-9);
    CHECK((projected.depth > scene.transform.near && projected.depth < scene.transform.far));
  }

  WriteImages(folder / "llff/images", 2);
  const torch::Tensor row =
      torch::tensor({0., 1., 0., 0., 30., -1., 0., 0., 0., 40., 0., 0., 1., 0., 50., 1., 9.}, torch::kFloat64);
  torch::Tensor rows = row.repeat({2, 1});
  rows[1][3] = 0.5;
  WriteNpy(folder / "llff/poses_bounds.npy", rows);
  CHECK(SolvePoses(folder / "llff", folder / "scene2", {}).source == "LLFF");
  const Scene llff = ReadSceneFolder(folder / "scene2", FullSize());
  CHECK(std::abs(llff.transform.near / llff.transform.scale - 0.9) < 1e-9);
}
