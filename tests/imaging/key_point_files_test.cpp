#include "libeditnerf/imaging/key_point_files.h"

#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/npy_file.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

TEST_CASE("key point files keep every digit") {
  const ScratchFolder folder;
  KeyPointFiles written;
  written.scale = torch::rand({2}, torch::kFloat64) + 0.5;
  written.offset = torch::randn({2, 3}, torch::kFloat64);
  written.local = torch::randn({5, 2, 3}, torch::kFloat64);
  CHECK_FALSE(HasKeyPointFiles(folder.path()));
  WriteText(folder.path() / "data" / "k_points_auto_coor_2.txt", "1 0 0 0\n");  // of an earlier, larger set
  WriteKeyPointFiles(folder.path(), written);
  CHECK(HasKeyPointFiles(folder.path()));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "data" / "k_points_auto_coor_2.txt"));
  const KeyPointFiles read = ReadKeyPointFiles(folder.path());
  CHECK(torch::equal(read.local, written.local));
  CHECK(torch::equal(read.scale, written.scale));
  CHECK(torch::equal(read.offset, written.offset));
}

TEST_CASE("local coordinates are scale times position plus offset") {
  const ScratchFolder folder;
  WriteText(folder.path() / "data" / "k_points_auto.txt", "5.000e+00 7.0e+00 9 \r\n3,5,7\n\n");
  WriteText(folder.path() / "data" / "k_points_auto_coor_1.txt", "2.0\n1.0\n3.0\n5.0\n");  // counts from one
  const KeyPointFiles read = ReadKeyPointFiles(folder.path());
  CHECK(torch::equal(read.InSceneUnits(), torch::tensor({2., 2., 2., 1., 1., 1.}, torch::kFloat64).view({2, 1, 3})));
}

TEST_CASE("damaged key point files are named") {
  const ScratchFolder folder;
  const auto error = [&](const std::string& tracks, const std::string& local) {
    WriteText(folder.path() / "data" / "k_points_auto.txt", tracks);
    WriteText(folder.path() / "data" / "k_points_auto_coor_0.txt", local);
    return MessageOf<DataError>([&] { ReadKeyPointFiles(folder.path()); });
  };
  CHECK(error("1 2 3\n", "1 0 0 0") == "no error");
  CHECK_THAT(error("1 2 3 4\n", "1 0 0 0"), HasText("k_points_auto.txt: expected rows of 3 N numbers, found 4"));
  CHECK_THAT(error("", "1 0 0 0"), HasText("expected rows of 3 N numbers, found 0"));
  CHECK_THAT(error("1 2 3\n1 2\n", "1 0 0 0"), HasText("row 2 holds 2 numbers, expected 3"));
  CHECK_THAT(error("1 2 nan\n", "1 0 0 0"), HasText("row 1: expected finite numbers, found 'nan"));
  CHECK_THAT(error("1 2 3\n", "1 0 0"), HasText("k_points_auto_coor_0.txt: expected 4 numbers"));
  CHECK_THAT(error("1 2 3\n", "0 0 0 0"), HasText("expected a positive scale, found 0"));
  std::filesystem::remove(folder.path() / "data" / "k_points_auto_coor_0.txt");
  CHECK_THAT(MessageOf<DataError>([&] { ReadKeyPointFiles(folder.path()); }), HasText("coor_0.txt: no such file"));
}

TEST_CASE("median depth and flow read back, stacked in the order of the ids") {
  const ScratchFolder folder;
  const std::vector<std::string> ids = {"b", "a"};
  torch::Tensor depth = torch::rand({2, 3, 4});
  const torch::Tensor flow = torch::randn({3, 4, 2});
  depth[0][0][0] = std::numeric_limits<float>::quiet_NaN();
  for (int64_t i = 0; i < 2; ++i) WriteMedianDepth(folder.path(), ids[static_cast<size_t>(i)], depth[i]);
  WriteFlow(folder.path(), "b", flow);
  const torch::Tensor read = ReadMedianDepths(folder.path(), ids);
  CHECK(read[0][0][0].isnan().item<bool>());
  CHECK(torch::equal(read[1], depth[1]));
  CHECK(torch::equal(ReadFlows(folder.path(), ids), flow.unsqueeze(0)));
  WriteMedianDepth(folder.path(), "a", torch::ones({2, 2}));
  CHECK_THAT(MessageOf<DataError>([&] { ReadMedianDepths(folder.path(), ids); }),
             HasText("depth_median_a.npy: [2, 2], expected [3, 4] as in depth_median_b.npy"));
  WriteNpy(folder.path() / "flow" / "flow_b.npy", torch::ones({2, 2, 3}));
  CHECK_THAT(MessageOf<DataError>([&] { ReadFlow(folder.path(), "b"); }),
             HasText("flow_b.npy: expected [H, W, 2] floating point numbers, found [2, 2, 3]"));
}
