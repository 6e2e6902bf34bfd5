#include "libeditnerf/training/held_out.h"

#include <torch/types.h>

#include "libeditnerf/scene/timeline.h"
#include "libeditnerf/training/carried_pixels.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

// True distances of every pixel that shows the lid in the training frames, carried by key point 0.
DepthTargets LidPlaces(const Scene& scene) {
  const auto frames = torch::tensor(scene.train, torch::kInt64);
  const torch::Tensor where = (scene.truth->mask.index_select(0, frames) == 1).nonzero();
  DepthTargets places;
  places.frame = where.select(1, 0).contiguous();
  places.pixel = torch::stack({where.select(1, 2), where.select(1, 1)}, 1).contiguous();
  places.distance = scene.truth->depth.index_select(0, frames)
                        .index({where.select(1, 0), where.select(1, 1), where.select(1, 2)})
                        .to(torch::kFloat32);
  places.tolerance = torch::full_like(places.distance, 0.01F);
  places.key_point = torch::zeros_like(places.frame);
  return places;
}

}  // namespace

TEST_CASE("carried pixels are where a part is seen in validation frames") {
  const Scene scene = SmallScene("hinge", 8, 80);
  const DepthTargets places = LidPlaces(scene);
  const torch::Tensor pixels = CarriedPixels(scene, places, TrueTracks(scene));
  const auto val = torch::tensor(scene.val, torch::kInt64);
  torch::Tensor found = torch::zeros({val.size(0) * scene.height() * scene.width()}, torch::kBool);
  found.index_fill_(0, pixels, true);
  const torch::Tensor lid = (scene.truth->mask.index_select(0, val) == 1).flatten();
  REQUIRE(lid.sum().item<int64_t>() > 100);
  // A pixel around each: nearly all of the lid, and little beside it.
  CHECK(found.logical_and(lid).sum().item<double>() > 0.9 * lid.sum().item<double>());
  CHECK(found.logical_and(~lid).sum().item<double>() < 0.4 * lid.sum().item<double>());

  DepthTargets resting = places;
  resting.key_point = torch::full_like(places.key_point, kStandsStill);
  CHECK(CarriedPixels(scene, resting, TrueTracks(scene)).numel() == 0);
  CHECK(CarriedPixels(scene, {}, {}).numel() == 0);
}

TEST_CASE("places go along with their key point to a frame between two training frames") {
  Scene scene = SmallScene("hinge", 8, 80);
  // The second training frame is not trained on: its state lies between those of the first and third.
  const int64_t between = scene.train[1];
  scene.train.erase(scene.train.begin() + 1);
  scene.val = {between};
  REQUIRE(!LocateInTime(scene, between).trained);
  const Camera& camera = scene.frames[static_cast<size_t>(between)].camera;
  const Camera& before = scene.frames[static_cast<size_t>(scene.train[0])].camera;
  const torch::Tensor tracks = TrueTracks(scene);
  DepthTargets one;
  one.frame = torch::zeros({1}, torch::kInt64);
  one.pixel = torch::tensor({{40, 22}}, torch::kInt64);
  one.distance = torch::tensor({1.0F});
  one.tolerance = torch::tensor({0.01F});
  one.key_point = torch::zeros({1}, torch::kInt64);
  const torch::Tensor moved = 0.5 * (tracks[1][0] - tracks[0][0]).to(torch::kFloat64);
  const Vec3 point = before.position + before.DirectionThrough(40.5, 22.5) +
                     Vec3{moved[0].item<double>(), moved[1].item<double>(), moved[2].item<double>()};
  const Projected seen = Project(camera, point);
  const int64_t middle = static_cast<int64_t>(seen.v) * scene.width() + static_cast<int64_t>(seen.u);
  const torch::Tensor pixels = CarriedPixels(scene, one, tracks);
  REQUIRE(pixels.size(0) == 9);
  CHECK(pixels[4].item<int64_t>() == middle);
}

TEST_CASE("held-out PSNR of chosen pixels is of those alone") {
  const Scene& scene = TinyScene();
  const Run run = MakeRun(SmallFast(), FieldStage::kTrain, scene, TrueTracks(scene), torch::kCPU);
  const auto psnr = [&](const torch::Tensor& pixels, int64_t rays) {
    return HeldOut(scene, pixels, rays, torch::kCPU).Psnr(*run.field, *run.renderer);
  };
  CHECK_FALSE(psnr(torch::empty({0}, torch::kInt64), 10).has_value());
  const torch::Tensor first = torch::arange(100), second = torch::arange(300, 400);
  const auto mse = [&](const torch::Tensor& pixels) { return std::pow(10, -*psnr(pixels, 1000) / 10); };
  CHECK(mse(torch::cat({first, second})) == Approx((mse(first) + mse(second)) / 2).epsilon(1e-4));
  CHECK(psnr(first, 20).has_value());
}
