#include "libeditnerf/training/error_map.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// Two images of 10 x 13 pixels: two by two cells each, most of them cut off.
constexpr int64_t kFrames = 2, kHeight = 10, kWidth = 13, kPixels = kFrames * kHeight * kWidth;

torch::Tensor AllPixels() { return torch::arange(kPixels, torch::kInt64); }

// Shares of the four cells of the first image and of the second one in draws by the map.
torch::Tensor SharesOf(const ErrorMap& map, int64_t count) {
  const torch::Tensor pixel = map.Draw(count), row = pixel.div(kWidth, "floor");
  const torch::Tensor frame = row.div(kHeight, "floor"), y = row % kHeight, x = pixel % kWidth;
  const torch::Tensor cell =
      torch::where(frame == 0, (y >= 8).to(torch::kInt64) * 2 + (x >= 8).to(torch::kInt64), torch::full_like(frame, 4));
  return torch::bincount(cell, {}, 5).to(torch::kFloat64) / static_cast<double>(count);
}

}  // namespace

TEST_CASE("an error map that knows nothing draws all pixels alike, and each counts for one") {
  torch::manual_seed(1);
  const ErrorMap map(kFrames, kHeight, kWidth, 0.4);
  const torch::Tensor drawn = map.Draw(100 * kPixels);
  const torch::Tensor count = torch::bincount(drawn, {}, kPixels).to(torch::kFloat64);
  REQUIRE(count.size(0) == kPixels);  // no pixel beyond the last
  CHECK((count - 100).abs().max().item<double>() < 60);
  CHECK(torch::allclose(map.Emphasis(AllPixels()), torch::ones({kPixels})));
  CHECK(map.Draw(0).size(0) == 0);
  CHECK(map.Emphasis(torch::empty({0}, torch::kInt64)).size(0) == 0);
}

TEST_CASE("an error map draws a cell by its area and the root of its error, once it has settled") {
  torch::manual_seed(2);
  ErrorMap map(kFrames, kHeight, kWidth, 0.4);
  // The first cell is off by twice as much as all others.
  const torch::Tensor pixel = AllPixels(), y = pixel.div(kWidth, "floor") % kHeight, x = pixel % kWidth;
  const torch::Tensor first = (pixel < kWidth * kHeight).logical_and(y < 8).logical_and(x < 8);
  torch::Tensor missed = torch::where(first, torch::full({kPixels}, 0.04F), torch::full({kPixels}, 0.01F));
  for (int i = 0; i < 10; ++i) map.Learn(pixel, missed);
  const double before = 64.0 / kPixels, after = 2 * 64.0 / (kPixels + 64);
  CHECK(SharesOf(map, 100000)[0].item<double>() == Approx(before).epsilon(0.05));
  map.Settle();
  const torch::Tensor shares = SharesOf(map, 100000);
  CHECK(shares[0].item<double>() == Approx(after).epsilon(0.05));
  CHECK(shares[3].item<double>() == Approx(10.0 / (kPixels + 64)).epsilon(0.1));
  CHECK(shares[4].item<double>() == Approx(130.0 / (kPixels + 64)).epsilon(0.05));
  const torch::Tensor emphasis = map.Emphasis(pixel);
  CHECK(emphasis[0].item<double>() == Approx(1 / (0.6 + 0.4 * after / before)).epsilon(1e-3));
  // By their chances, they are the mean over all pixels.
  const torch::Tensor chance = 0.6 + 0.4 * torch::where(first, torch::full({kPixels}, after / before),
                                                        torch::full({kPixels}, after / before / 2));
  CHECK((emphasis * chance).mean().item<double>() == Approx(1).epsilon(1e-3));
}

TEST_CASE("an error map leaves out what is not finite and never forgets a cell") {
  torch::manual_seed(3);
  ErrorMap map(1, 8, 16, 0.5);
  const torch::Tensor left = torch::zeros({1000}, torch::kInt64), right = torch::full({1000}, 8, torch::kInt64);
  map.Learn(left, torch::zeros({1000}));
  map.Learn(right, torch::full({1000}, 1.0F));
  map.Learn(right, torch::full({1000}, NAN));
  map.Learn(left, torch::full({1000}, INFINITY));
  map.Settle();
  const torch::Tensor share = (map.Draw(1000000) % 16 < 8).to(torch::kFloat64).mean();
  CHECK(share.item<double>() == Approx(0.001).epsilon(0.15));
  const torch::Tensor emphasis = map.Emphasis(torch::tensor({0, 8}, torch::kInt64));
  CHECK(emphasis[0].item<double>() == Approx(2).epsilon(0.01));
  CHECK(emphasis[1].item<double>() == Approx(1 / 1.5).epsilon(0.01));
}

TEST_CASE("an error map goes on from its state, and refuses that of other images") {
  ErrorMap map(kFrames, kHeight, kWidth, 0.4), copy(kFrames, kHeight, kWidth, 0.4);
  torch::manual_seed(4);
  map.Learn(map.Draw(500), torch::rand({500}));
  map.Settle();
  map.Learn(map.Draw(500), torch::rand({500}));
  copy.SetState(map.State());
  for (int i = 0; i < 2; ++i) {
    torch::manual_seed(5);
    const torch::Tensor drawn = map.Draw(300);
    torch::manual_seed(5);
    CHECK(torch::equal(copy.Draw(300), drawn));
    CHECK(torch::equal(copy.Emphasis(drawn), map.Emphasis(drawn)));
    map.Settle();
    copy.Settle();
  }
  CHECK_THROWS_AS(map.SetState(torch::zeros({2, kFrames, 2, 3})), ShapeError);
  for (const float wrong : {-1.0F, NAN, INFINITY}) {
    torch::Tensor state = map.State();
    state[1][0][1][1] = wrong;
    CHECK_THROWS_AS(copy.SetState(state), CheckpointError);
  }
  CHECK(torch::equal(copy.State(), map.State()));
  CHECK_THROWS_AS(map.Learn(torch::zeros({3}, torch::kInt64), torch::zeros({2})), ShapeError);
}
