#include "libeditnerf/imaging/importers/llff.h"

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

// A camera at (1, 2, 3) that looks along world +x with world z up: down = -z, right = -y, backward = -x.
torch::Tensor Row() {
  return torch::tensor({0., 0., -1., 1., 30., 0., -1., 0., 2., 40., -1., 0., 0., 3., 50., 0.5, 9.}, torch::kFloat64);
}

}  // namespace

TEST_CASE("LLFF poses become OpenCV cameras") {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder.path() / "images");
  for (const char* name : {"b.png", "a.png"}) {
    WritePng(folder.path() / "images" / name, torch::zeros({30, 40, 3}, torch::kUInt8));
  }
  WriteText(folder.path() / "images" / "notes.txt", "not an image");
  WriteNpy(folder / "poses_bounds.npy", Row().repeat({2, 1}));
  const ImportedModel model = ReadLlffPoses(folder / "poses_bounds.npy", folder / "images");
  REQUIRE(model.frames.size() == 2);
  CHECK(model.frames[0].name == "a.png");
  CHECK(model.frames[0].near == 0.5);
  CHECK(model.frames[0].far == 9);
  const Camera& camera = model.frames[0].camera;
  CHECK(camera.width == 40);
  CHECK(camera.height == 30);
  CHECK(Norm(camera.position - Vec3{1, 2, 3}) == 0);
  const Projected projected = Project(camera, {3, 1.8, 3.4});  // 2 ahead, 0.2 to the right, 0.4 up
  CHECK(std::abs(projected.depth - 2) < 1e-12);
  CHECK(std::abs(projected.u - 25) < 1e-9);
  CHECK(std::abs(projected.v - 5) < 1e-9);
}

TEST_CASE("damaged LLFF files are refused by name") {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder.path() / "images");
  WritePng(folder.path() / "images" / "a.png", torch::zeros({30, 40, 3}, torch::kUInt8));
  const auto error = [&](const torch::Tensor& rows) {
    WriteNpy(folder / "poses_bounds.npy", rows);
    return MessageOf<DataError>([&] { ReadLlffPoses(folder / "poses_bounds.npy", folder / "images"); });
  };
  CHECK(error(Row().unsqueeze(0)) == "no error");
  CHECK_THAT(error(Row()), HasText("poses_bounds.npy: expected [F, 17] floating point numbers, found [17]"));
  CHECK_THAT(error(Row().repeat({3, 1})), HasText("holds 3 poses, but"));
  torch::Tensor damaged = Row().unsqueeze(0);
  damaged[0][3] = NAN;
  CHECK_THAT(error(damaged), HasText("row 0: expected finite numbers, found nan"));
  damaged = Row().unsqueeze(0);
  damaged[0][15] = 10;
  CHECK_THAT(error(damaged), HasText("expected 0 < nearest < farthest depth, found 10 and 9"));
  damaged = Row().unsqueeze(0);
  damaged[0][1] = 1;
  CHECK_THAT(error(damaged), HasText("row 0: expected a rotation matrix"));
}
