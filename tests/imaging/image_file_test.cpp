#include "libeditnerf/imaging/image_file.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

TEST_CASE("png files keep every pixel") {
  const ScratchFolder folder;
  const auto path = folder / "image.png";
  const torch::Tensor image = torch::randint(0, 256, {7, 5, 3}, torch::kUInt8);
  WritePng(path, image);
  CHECK(torch::equal(ReadImage(path), image));
  CHECK_FALSE(std::filesystem::exists(path.string() + ".partial"));
  const torch::Tensor mask = torch::randint(0, 256, {4, 6}, torch::kUInt8);
  WritePng(path, mask);
  CHECK(torch::equal(ReadMask(path), mask));
  CHECK(torch::equal(ReadImage(path), mask.unsqueeze(-1).expand({4, 6, 3})));
}

TEST_CASE("red is the first channel") {
  const ScratchFolder folder;
  torch::Tensor red = torch::zeros({2, 2, 3}, torch::kUInt8);
  red.select(2, 0).fill_(255);
  WritePng(folder / "red.png", red);
  CHECK(torch::equal(ReadImage(folder / "red.png"), red));
  WriteText(folder / "red.ppm", "P3 1 1 255\n255 0 0\n");
  CHECK(ReadImage(folder / "red.ppm")[0][0][0].item<int>() == 255);
}

TEST_CASE("images that cannot be read are named") {
  const ScratchFolder folder;
  CHECK_THAT(MessageOf<DataError>([&] { ReadImage(folder / "none.png"); }), HasText("none.png: no such file"));
  WriteText(folder / "text.png", "not an image");
  CHECK_THAT(MessageOf<DataError>([&] { ReadImage(folder / "text.png"); }),
             HasText("text.png: cannot be decoded as an image (12 bytes)"));
  WriteText(folder / "empty.png", "");
  CHECK_THAT(MessageOf<DataError>([&] { ReadImage(folder / "empty.png"); }), HasText("cannot be decoded"));
  WritePng(folder / "whole.png", torch::randint(0, 256, {40, 40, 3}, torch::kUInt8));
  WriteText(folder / "half.png", ReadText(folder / "whole.png").substr(0, 2000));
  CHECK_THAT(MessageOf<DataError>([&] { ReadImage(folder / "half.png"); }), HasText("half.png: cannot be decoded"));
  CHECK_THAT(MessageOf<DataError>([&] { ReadMask(folder / "whole.png"); }),
             HasText("expected one channel of 8 bits, found 3 channels"));
  CHECK_THROWS_AS(WritePng(folder / "x.png", torch::zeros({3, 3, 4}, torch::kUInt8)), ShapeError);
  CHECK_THROWS_AS(WritePng(folder / "x.png", torch::zeros({3, 3, 3})), ShapeError);
  CHECK_THAT(MessageOf<DataError>([&] {
               WritePng(folder / "no" / "x.png", torch::zeros({3, 3}, torch::kUInt8));
             }),
             HasText("x.png: cannot be written: No such file or directory"));
}

TEST_CASE("area averaging takes the mean of each block") {
  const torch::Tensor image = torch::tensor({{0, 100, 8, 8}, {100, 200, 8, 8}}, torch::kUInt8);
  CHECK(torch::equal(ResizeByArea(image, 1, 2), torch::tensor({{100, 8}}, torch::kUInt8)));
}
