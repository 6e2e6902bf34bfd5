#include "libeditnerf/editing/point_track.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "tests/catch.h"
#include "tests/editing/moving_patch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

PointTrack Follow(const std::filesystem::path& path, const PointTrackOptions& options) {
  FrameReader frames(path);
  return TrackPoint(frames, DisFlow(), options, "clip");
}

}  // namespace

TEST_CASE("a point is followed through a video and through images, as fast as it moves") {
  const ScratchFolder folder;
  WriteMovingPatch(folder / "clip.mp4", 12);
  std::filesystem::create_directories(folder / "frames");
  for (int64_t t = 0; t < 12; ++t) {
    WritePng(folder / ("frames/" + std::to_string(100 + t) + ".png"), MovingPatch(t));
  }
  PointTrackOptions options;
  options.start = MovingPatchCenter(0);
  for (const char* name : {"clip.mp4", "frames"}) {
    INFO(name);
    const PointTrack track = Follow(folder / name, options);
    REQUIRE(track.at.size() == 12);
    CHECK(track.width == 128);
    CHECK(Distance(track.at[11], MovingPatchCenter(11)) < 1);
  }
  options.longest_side = 64;  // in small, and brought back to the video's pixels
  CHECK(Distance(Follow(folder / "frames", options).at[11], MovingPatchCenter(11)) < 2);
  options.longest_side = 640;
  options.first_frame = 3;
  options.last_frame = 6;
  options.start = MovingPatchCenter(3);
  const PointTrack part = Follow(folder / "clip.mp4", options);
  REQUIRE(part.at.size() == 4);
  CHECK(Distance(part.at[3], MovingPatchCenter(6)) < 1);
}

TEST_CASE("a point that is lost is reported with its frame, and one outside with the picture's size") {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder / "frames");
  torch::manual_seed(1);
  for (int64_t t = 0; t < 12; ++t) {
    const torch::Tensor image = MovingPatch(t);
    if (t >= 6) image.copy_(torch::randint(0, 255, image.sizes(), torch::kUInt8));  // nothing leads there
    WritePng(folder / ("frames/" + std::to_string(100 + t) + ".png"), image);
  }
  PointTrackOptions options;
  options.start = MovingPatchCenter(0);
  options.patience = 2;
  // By chance the flow there and back may agree for a frame or two of noise.
  CHECK_THROWS_WITH(Follow(folder / "frames", options),
                    Catch::Matchers::Matches("clip: the point is lost at frame [678]: .*"));
  options.last_frame = 5;
  CHECK(Follow(folder / "frames", options).at.size() == 6);
  options.start = {200, 10};
  CHECK_THROWS_WITH(Follow(folder / "frames", options), HasText("200,10 is not in the picture, which has 128 x 96"));
  options.first_frame = 12;
  CHECK_THROWS_WITH(Follow(folder / "frames", options), HasText("there is no frame 12; it has 12"));
}

TEST_CASE("what holds no frames is refused by name") {
  const ScratchFolder folder;
  CHECK_THROWS_WITH(FrameReader(folder.path()), HasText("found no image"));
  CHECK_THROWS_WITH(FrameReader(folder / "nothing.mp4"), HasText("nothing.mp4: no such file"));
  WriteText(folder / "text.mp4", "no video");
  CHECK_THROWS_WITH(FrameReader(folder / "text.mp4"), HasText("text.mp4: cannot be opened as a video"));
}
