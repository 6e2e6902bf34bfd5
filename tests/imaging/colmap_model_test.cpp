#include "libeditnerf/imaging/importers/colmap_model.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/imaging/colmap_fixture.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

void CheckArc(const ImportedModel& model, const ColmapFixture& fixture) {
  REQUIRE(model.frames.size() == fixture.names.size());
  for (size_t i = 0; i < model.frames.size(); ++i) {
    const ImportedFrame& frame = model.frames[i];
    const Camera& expected = fixture.cameras[i];
    CHECK(frame.name == fixture.names[i]);
    CHECK(frame.image_path == std::filesystem::path("images") / fixture.names[i]);
    CHECK(Norm(frame.camera.position - expected.position) < 1e-12);
    for (size_t k = 0; k < 9; ++k) CHECK(std::abs(frame.camera.orientation.m[k] - expected.orientation.m[k]) < 1e-12);
    CHECK(frame.camera.focal_length == 35.5);
    CHECK(frame.camera.principal_point == std::array<double, 2>{20.25, 14.75});
    CHECK(frame.camera.radial_distortion[0] == 0.01);
    CHECK(frame.camera.width == 40);
    CHECK(frame.camera.height == 30);
    CHECK(frame.seen_points.size() == fixture.points.size());
  }
  CHECK(model.points.size(0) == static_cast<int64_t>(fixture.points.size()));
  CHECK(model.points[3][2].item<double>() == fixture.points[3].z);
  CHECK(model.mean_reprojection_error == 0.5);
}

std::string ErrorOf(const std::filesystem::path& folder) {
  return MessageOf<DataError>([&] { ReadColmapModel(folder, ""); });
}

}  // namespace

TEST_CASE("text and binary COLMAP models give the same cameras and points") {
  const ScratchFolder folder;
  const ColmapFixture fixture = ArcFixture(4);
  CHECK_FALSE(IsColmapModel(folder.path()));
  WriteColmapText(fixture, folder.path());
  CHECK(IsColmapModel(folder.path()));
  CheckArc(ReadColmapModel(folder.path(), "images"), fixture);
  CHECK(CountColmapImages(folder.path()) == 4);
  const ScratchFolder binary;
  WriteColmapBinary(fixture, binary.path());
  CheckArc(ReadColmapModel(binary.path(), "images"), fixture);
}

TEST_CASE("every supported COLMAP camera model keeps its parameters") {
  const ScratchFolder folder;
  const ColmapFixture fixture = ArcFixture(2);
  const auto camera = [&](const std::string& line) {
    WriteColmapText(fixture, folder.path(), line);
    return ReadColmapModel(folder.path(), "").frames[0].camera;
  };
  CHECK(camera("1 SIMPLE_PINHOLE 40 30 31 20 15").focal_length == 31);
  CHECK(camera("1 PINHOLE 40 30 32 48 20 15").pixel_aspect_ratio == 1.5);
  CHECK(camera("1 RADIAL 40 30 31 20 15 0.1 0.2").radial_distortion == std::array<double, 3>{0.1, 0.2, 0});
  const Camera opencv = camera("1 OPENCV 40 30 32 32 20 15 0.1 0.2 0.3 0.4");
  CHECK(opencv.radial_distortion == std::array<double, 3>{0.1, 0.2, 0});
  CHECK(opencv.tangential_distortion == std::array<double, 2>{0.3, 0.4});
  // OpenCV's formula: x (1 + k1 r^2 + k2 r^4) + 2 p1 x y + p2 (r^2 + 2 x^2), at x = 0.5, y = 0.25.
  Camera at_origin = opencv;
  at_origin.orientation = Mat3();
  at_origin.position = {};
  const double r2 = 0.3125, x = 0.5 * (1 + 0.1 * r2 + 0.2 * r2 * r2) + 2 * 0.3 * 0.125 + 0.4 * (r2 + 0.5);
  CHECK(std::abs(Project(at_origin, {1, 0.5, 2}).u - (32 * x + 20)) < 1e-12);
  WriteColmapText(fixture, folder.path(), "1 OPENCV_FISHEYE 40 30 32 32 20 15 0 0 0 0");
  CHECK_THAT(ErrorOf(folder.path()), HasText("camera 1: camera model OPENCV_FISHEYE is not supported"));
  CHECK_THAT(ErrorOf(folder.path()), HasText("image_undistorter"));
  WriteColmapText(fixture, folder.path(), "1 PINHOLE 40 30 32 32 20");
  CHECK_THAT(ErrorOf(folder.path()), HasText("expected 4 parameters for model PINHOLE, found 3"));
}

TEST_CASE("damaged COLMAP models are refused by name") {
  const ScratchFolder folder;
  const ColmapFixture fixture = ArcFixture(2);
  CHECK_THAT(ErrorOf(folder.path()), HasText("expected a COLMAP model: cameras, images and points3D"));
  WriteColmapBinary(fixture, folder.path());
  for (const std::string name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const std::string whole = ReadText(folder / name);
    for (const size_t length : {size_t{0}, size_t{7}, size_t{20}, whole.size() / 2, whole.size() - 1}) {
      WriteText(folder / name, whole.substr(0, length));
      CHECK_THAT(ErrorOf(folder.path()), HasText(name));
    }
    std::string hostile = whole;
    hostile.replace(0, 8, 8, '\x7f');  // a count that no memory could hold
    WriteText(folder / name, hostile);
    CHECK_THAT(ErrorOf(folder.path()), HasText(name + ": announces 9187201950435737471 records, but only"));
    WriteText(folder / name, whole);
  }
  CHECK(ErrorOf(folder.path()) == "no error");
  ColmapFixture twins = fixture;
  twins.names[1] = twins.names[0];
  WriteColmapBinary(twins, folder.path());
  CHECK_THAT(ErrorOf(folder.path()), HasText("image 000000.png is there twice"));
  const ScratchFolder text;
  WriteColmapText(fixture, text.path(), "2 PINHOLE 40 30 32 32 20 15");
  CHECK_THAT(ErrorOf(text.path()), HasText("image 000001.png: names camera 1, which the model does not have"));
  WriteColmapText(fixture, text.path(), "1 PINHOLE 40 30 32 abc 20 15");
  CHECK_THAT(ErrorOf(text.path()), HasText("cameras.txt:2: expected a number, found 'abc'"));
  WriteColmapText(fixture, text.path());
  WriteText(text / "points3D.txt", "10 0 0 0 0 0 0 0.5\n");
  CHECK_THAT(ErrorOf(text.path()), HasText("observes point 11, which points3D does not have"));
}
