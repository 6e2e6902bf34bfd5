#include "libeditnerf/imaging/video_file.h"

#include <cstdlib>
#include <iterator>
#include <utility>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

// Frame i is grey of brightness 40 + 10 i with a red square.
void WriteSteps(const std::filesystem::path& path, int64_t count, int64_t height, int64_t width) {
  VideoWriter writer(path, width, height, 25);
  for (int64_t i = 0; i < count; ++i) {
    torch::Tensor frame = torch::full({height, width, 3}, 40 + 10 * i, torch::kUInt8);
    frame.slice(0, 0, 16).slice(1, 0, 16).copy_(torch::tensor({200, 20, 20}, torch::kUInt8));
    writer.Write(frame);
  }
  writer.Finish();
}

}  // namespace

TEST_CASE("a video that was written reads back in order and in colour") {
  const ScratchFolder folder;
  const auto path = folder / "clip.mp4";
  WriteSteps(path, 6, 47, 65);  // odd sides
  VideoReader reader(path);
  CHECK(reader.frame_count() == 6);
  CHECK(reader.fps() == 25);
  CHECK(reader.width() == 66);
  CHECK(reader.height() == 48);
  int64_t count = 0;
  while (const auto frame = reader.Next()) {
    CHECK((*frame)[40][50].to(torch::kFloat32).sub(40 + 10 * count).abs().max().item<float>() < 8);
    CHECK((*frame)[6][6][0].item<int>() > 150);
    CHECK((*frame)[6][6][2].item<int>() < 80);
    ++count;
  }
  CHECK(count == 6);
  CHECK_FALSE(reader.Next());
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("evenly spaced frames are taken from a longer video") {
  const ScratchFolder folder;
  WriteSteps(folder / "clip.mp4", 10, 48, 64);
  const auto frames = ReadVideoFrames(folder / "clip.mp4", 4);  // 0, 2, 5, 7
  REQUIRE(frames.size() == 4);
  for (const auto& [frame, index] : {std::pair<int, int>{0, 0}, {1, 2}, {2, 5}, {3, 7}}) {
    CHECK(std::abs(frames[static_cast<size_t>(frame)][40][50][1].item<int>() - (40 + 10 * index)) < 8);
  }
  CHECK(ReadVideoFrames(folder / "clip.mp4", 100).size() == 10);
}

TEST_CASE("a video that is not finished leaves nothing behind") {
  const ScratchFolder folder;
  {
    VideoWriter writer(folder / "clip.mp4", 32, 32, 25);
    writer.Write(torch::zeros({32, 32, 3}, torch::kUInt8));
    CHECK_THROWS_AS(writer.Write(torch::zeros({16, 32, 3}, torch::kUInt8)), ShapeError);
  }
  CHECK(std::filesystem::is_empty(folder.path()));
  CHECK_THAT(MessageOf<DataError>([&] { VideoWriter(folder / "none/clip.mp4", 32, 32, 25); }),
             HasText("clip.mp4: cannot be opened for writing"));
}

TEST_CASE("videos that cannot be decoded are named") {
  const ScratchFolder folder;
  CHECK_THAT(MessageOf<DataError>([&] { VideoReader(folder / "none.mp4"); }), HasText("none.mp4: no such file"));
  WriteText(folder / "text.mp4", "this is not a video");
  CHECK_THAT(MessageOf<DataError>([&] { VideoReader(folder / "text.mp4"); }),
             HasText("text.mp4: cannot be opened as a video"));
  WriteSteps(folder / "clip.mp4", 10, 48, 64);
  const std::string whole = ReadText(folder / "clip.mp4");
  WriteText(folder / "cut.mp4", whole.substr(0, whole.size() / 2));
  CHECK_THAT(MessageOf<DataError>([&] { VideoReader(folder / "cut.mp4"); }),
             HasText("cut.mp4: cannot be opened as a video; it is damaged, truncated"));
}
