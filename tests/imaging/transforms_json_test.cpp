#include "libeditnerf/imaging/importers/transforms_json.h"

#include <array>
#include <cmath>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

// Blender's usual pose: at (0, -4, 1), looking along +y with z up.
Json TwoFrames() {
  const Json matrix = {{1, 0, 0, 0}, {0, 0, -1, -4}, {0, 1, 0, 1}, {0, 0, 0, 1}};
  return {{"camera_angle_x", 0.5},
          {"frames",
           {{{"file_path", "./train/r_1"}, {"time", 0.75}, {"transform_matrix", matrix}},
            {{"file_path", "./train/r_0.jpg"}, {"time", 0.25}, {"transform_matrix", matrix}}}}};
}

}  // namespace

TEST_CASE("transforms.json becomes OpenCV cameras in time order") {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder.path() / "train");
  WritePng(folder.path() / "train" / "r_1.png", torch::zeros({30, 40, 3}, torch::kUInt8));
  WriteText(folder / "transforms.json", TwoFrames().dump());
  const ImportedModel model = ReadTransformsJson(folder / "transforms.json");
  REQUIRE(model.frames.size() == 2);
  CHECK(model.frames[0].time == 0.25);
  CHECK(model.frames[0].image_path == folder.path() / "train" / "r_0.jpg");
  CHECK(model.frames[1].image_path == folder.path() / "train" / "r_1.png");
  const Camera& camera = model.frames[0].camera;
  CHECK(camera.width == 40);
  CHECK(std::abs(camera.focal_length - 20 / std::tan(0.25)) < 1e-12);
  // A point in front, to the right and above lands right of and above the centre.
  const Projected projected = Project(camera, {0.4, 0, 1.2});
  CHECK(projected.valid);
  CHECK(std::abs(projected.depth - 4) < 1e-12);
  CHECK(std::abs(projected.u - (20 + camera.focal_length * 0.1)) < 1e-9);
  CHECK(std::abs(projected.v - (15 - camera.focal_length * 0.05)) < 1e-9);
}

TEST_CASE("intrinsics in pixels and frames of their own are taken from transforms.json") {
  const ScratchFolder folder;
  Json json = TwoFrames();
  json.erase("camera_angle_x");
  for (const auto& [key, value] : {std::pair<const char*, double>{"w", 64},
                                   {"h", 48},
                                   {"fl_x", 50},
                                   {"fl_y", 55},
                                   {"cx", 31},
                                   {"cy", 25},
                                   {"k1", 0.1},
                                   {"p2", 0.2}}) {
    json[key] = value;
  }
  json["frames"][0]["fl_x"] = 100;
  json["frames"][0].erase("time");
  WriteText(folder / "transforms.json", json.dump());
  const ImportedModel model = ReadTransformsJson(folder / "transforms.json");
  CHECK(model.frames[0].camera.focal_length == 100);  // without all times the file's order stays
  CHECK(model.frames[1].camera.focal_length == 50);
  CHECK(std::abs(model.frames[1].camera.pixel_aspect_ratio - 1.1) < 1e-12);
  CHECK(model.frames[1].camera.principal_point == std::array<double, 2>{31, 25});
  CHECK(model.frames[1].camera.radial_distortion[0] == 0.1);
  CHECK(model.frames[1].camera.tangential_distortion[1] == 0.2);
}

TEST_CASE("damaged transforms.json files are refused by name") {
  const ScratchFolder folder;
  const auto error = [&](const Json& json) {
    WriteText(folder / "transforms.json", json.dump());
    return MessageOf<DataError>([&] { ReadTransformsJson(folder / "transforms.json"); });
  };
  Json json = TwoFrames();
  CHECK_THAT(error(json), HasText("r_1.png: no such file"));  // its size is needed
  json["w"] = 40;
  json["h"] = 30;
  CHECK(error(json) == "no error");
  Json damaged = json;
  damaged["frames"][1].erase("transform_matrix");
  CHECK_THAT(error(damaged), HasText("transforms.json: frame 1: 'transform_matrix' is missing"));
  damaged = json;
  damaged["frames"][0]["transform_matrix"][0][0] = 3;
  CHECK_THAT(error(damaged), HasText("frame 0: transform_matrix: expected a rotation matrix"));
  damaged = json;
  damaged.erase("camera_angle_x");
  CHECK_THAT(error(damaged), HasText("frame 0: expected 'fl_x' [pixels] or 'camera_angle_x' [radians]"));
  damaged = json;
  damaged["frames"] = Json::array();
  CHECK_THAT(error(damaged), HasText("frames: expected a list of frames"));
}
