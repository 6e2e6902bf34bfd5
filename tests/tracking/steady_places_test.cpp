#include "libeditnerf/tracking/steady_places.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr int64_t kFrames = 20, kWidth = 64, kHeight = 48;

// A camera that rests before a wall at distance 2, with noise for a picture.
Clip Wall(int64_t frames = kFrames) {
  torch::manual_seed(5);
  const torch::Tensor picture = torch::randint(90, 160, {kHeight, kWidth, 3}, torch::kFloat32);
  Camera camera;
  camera.focal_length = 60;
  camera.principal_point = {32, 24};
  camera.width = kWidth;
  camera.height = kHeight;
  Clip clip;
  clip.width = kWidth;
  clip.height = kHeight;
  for (int64_t t = 0; t < frames; ++t) {
    clip.cameras.push_back(camera);
    clip.images.push_back(picture.to(torch::kUInt8));
    clip.depth.push_back(torch::full({kHeight, kWidth}, 2.0F));
  }
  return clip;
}

// Multiplies the colours of a square of frames [from, to).
void Paint(Clip* clip, int64_t column, int64_t from, int64_t to, const torch::Tensor& factor) {
  for (int64_t t = from; t < to; ++t) {
    torch::Tensor& image = clip->images[static_cast<size_t>(t)];
    torch::Tensor changed = image.to(torch::kFloat32);
    changed.slice(0, 10, 30).slice(1, column, column + 16) *= factor;
    image = changed.clamp(0, 255).to(torch::kUInt8).contiguous();
  }
}

DepthTargets PlaceAt(const std::vector<int64_t>& columns, int64_t row, double distance) {
  const auto count = static_cast<int64_t>(columns.size());
  DepthTargets places;
  places.frame = torch::zeros({count}, torch::kInt64);
  places.pixel = torch::stack({torch::tensor(columns, torch::kInt64), torch::full({count}, row, torch::kInt64)}, 1);
  places.distance = torch::full({count}, distance, torch::kFloat32);
  places.tolerance = torch::zeros({count});
  places.key_point = torch::full({count}, kStandsStill, torch::kInt64);
  return places;
}

std::vector<int64_t> Marks(const DepthTargets& places) {
  const int64_t* const mark = places.key_point.data_ptr<int64_t>();
  return {mark, mark + places.size()};
}

}  // namespace

TEST_CASE("places over which a shadow passes are not steady; those behind something else, or exposed otherwise, are") {
  Clip clip = Wall();
  Paint(&clip, 4, 8, 12, torch::tensor({0.6F, 0.6F, 0.6F}));   // a shadow
  Paint(&clip, 24, 8, 12, torch::tensor({0.5F, 1.4F, 0.7F}));  // another thing
  for (int64_t t = 14; t < kFrames; ++t) {
    clip.images[static_cast<size_t>(t)] =
        (clip.images[static_cast<size_t>(t)].to(torch::kFloat32) * 0.7).to(torch::kUInt8).contiguous();
  }
  DepthTargets places = PlaceAt({12, 32, 52, 1}, 20, 2);  // the last without room for a patch
  CHECK(MarkUnsteadyPlaces(clip, {}, &places) == 1);
  CHECK(Marks(places) == std::vector<int64_t>{kOtherLight, kStandsStill, kStandsStill, kStandsStill});
}

TEST_CASE("shade that the sky lights in another hue is shade") {
  Clip clip = Wall();
  Paint(&clip, 4, 8, 12, torch::tensor({0.45F, 0.48F, 0.53F}));
  Paint(&clip, 24, 8, 12, torch::tensor({0.85F, 0.96F, 1.05F}));  // as much of a hue, and hardly darker
  DepthTargets places = PlaceAt({12, 32, 52}, 20, 2);
  CHECK(MarkUnsteadyPlaces(clip, {}, &places) == 1);
  CHECK(Marks(places) == std::vector<int64_t>{kOtherLight, kStandsStill, kStandsStill});
}

TEST_CASE("how often a place is in the shade counts among the frames that see it") {
  constexpr int64_t kMany = 60;
  Clip clip = Wall(kMany);
  for (const int64_t column : {4, 24}) Paint(&clip, column, 8, 11, torch::tensor({0.6F, 0.6F, 0.6F}));
  for (size_t t = 30; t < kMany; ++t) clip.depth[t].slice(0, 10, 30).slice(1, 4, 20).fill_(1.5F);
  DepthTargets places = PlaceAt({12, 32, 46, 52, 56}, 20, 2);
  CHECK(MarkUnsteadyPlaces(clip, {}, &places) == 1);
  CHECK(Marks(places) == std::vector<int64_t>{kOtherLight, kStandsStill, kStandsStill, kStandsStill, kStandsStill});
}

TEST_CASE("what stands before a place and is as grey as it does not count as its shade") {
  Clip clip = Wall();
  Paint(&clip, 4, 8, 12, torch::tensor({0.6F, 0.6F, 0.6F}));
  Paint(&clip, 24, 8, 12, torch::tensor({0.6F, 0.6F, 0.6F}));
  for (size_t t = 8; t < 12; ++t) clip.depth[t].slice(0, 10, 30).slice(1, 24, 40).fill_(1.5F);
  DepthTargets places = PlaceAt({12, 32, 46, 52, 56}, 20, 2);
  CHECK(MarkUnsteadyPlaces(clip, {}, &places) == 1);
  CHECK(Marks(places) == std::vector<int64_t>{kOtherLight, kStandsStill, kStandsStill, kStandsStill, kStandsStill});
}

TEST_CASE("places on a part that rests are not steady; those behind it, beside it, and in other frames are") {
  const Clip clip = Wall();
  DepthTargets parts = PlaceAt({12}, 20, 1.5);
  parts.key_point.fill_(0);
  DepthTargets on = PlaceAt({13, 40}, 21, 1.51), behind = PlaceAt({13}, 21, 2), later = PlaceAt({13}, 21, 1.51);
  later.frame.fill_(3);
  DepthTargets places = Joined(Joined(on, behind), later);
  const torch::Tensor before = places.key_point;
  CHECK(MarkUnsteadyPlaces(clip, parts, &places) == 1);
  CHECK(Marks(places) == std::vector<int64_t>{kNotCarried, kStandsStill, kStandsStill, kStandsStill});
  CHECK(before.eq(kStandsStill).all().item<bool>());  // the caller's tensor is left alone
  DepthTargets none;
  CHECK(MarkUnsteadyPlaces(clip, parts, &none) == 0);
}
