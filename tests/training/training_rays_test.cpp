#include "libeditnerf/training/training_rays.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

Scene SmallScene() {
  SyntheticOptions options;
  options.frames = 4;
  options.val_frames = 0;
  options.edit_frames = 0;
  options.width = 16;
  options.height = 9;
  options.samples_per_side = 1;
  return MakeSyntheticScene("hinge", options);
}

}  // namespace

TEST_CASE("shares of the rays go through places that stand still or are carried, from shortly before them on") {
  torch::manual_seed(1);
  const Scene scene = SmallScene();
  TrainingRays rays(scene, scene.train, torch::kCPU);
  CHECK(rays.Sample(40).drawn == 0);
  CHECK(!rays.Sample(40).start.defined());
  rays.SetKnownPlaces({}, 0.5, 0.2);
  CHECK(rays.Sample(40).drawn == 0);
  // Of three places one stands still, one goes with key point 1, and one with none.
  const DepthTargets places = {torch::tensor({1, 3, 2}, torch::kInt64),
                               torch::tensor({5, 2, 11, 7, 8, 8}, torch::kInt64).view({3, 2}),
                               torch::tensor({0.5F, 0.7F, 0.9F}), torch::tensor({0.01F, 0.01F, 0.01F}),
                               torch::tensor({kStandsStill, int64_t{1}, kNotCarried})};
  const auto check = [&](double still_share, double carried_share, int64_t still, int64_t carried) {
    rays.SetKnownPlaces(places, still_share, carried_share);
    const RayTargets batch = rays.Sample(40);
    const int64_t drawn = still + carried;
    REQUIRE(batch.drawn == drawn);
    REQUIRE(batch.carrier.size(0) == drawn);
    CHECK((batch.start.slice(0, 0, 40 - drawn) == 0).all().item<bool>());
    CHECK((batch.carrier == kStandsStill).sum().item<int64_t>() == still);
    for (int64_t i = 40 - drawn; i < 40; ++i) {
      const bool stands = batch.carrier[i - 40 + drawn].item<int64_t>() == kStandsStill;
      CHECK(batch.frame[i].item<int64_t>() == (stands ? 1 : 3));
      CHECK(batch.start[i].item<float>() == Approx(stands ? 0.49 : 0.686));
      const torch::Tensor color = stands ? scene.images[scene.train[1]][2][5] : scene.images[scene.train[3]][7][11];
      CHECK(torch::allclose(batch.target[i], color.to(torch::kFloat32) / 255));
    }
  };
  check(0.25, 0, 10, 0);
  check(0, 0.2, 0, 8);
  check(0.25, 0.2, 10, 8);
}

TEST_CASE("rays through what stands still in changing light are drawn where light is kept, and say where they go") {
  torch::manual_seed(2);
  const Scene scene = SmallScene();
  TrainingRays rays(scene, scene.train, torch::kCPU);
  const DepthTargets places = {torch::tensor({1, 3}, torch::kInt64),
                               torch::tensor({5, 2, 11, 7}, torch::kInt64).view({2, 2}), torch::tensor({0.5F, 0.7F}),
                               torch::tensor({0.01F, 0.01F}), torch::tensor({kStandsStill, kOtherLight})};
  for (const bool any_light : {false, true}) {
    rays.SetKnownPlaces(places, 0.5, 0, any_light);
    const RayTargets batch = rays.Sample(60);
    REQUIRE(batch.drawn == 30);
    CHECK(((batch.carrier == kOtherLight).sum().item<int64_t>() > 0) == any_light);
    const torch::Tensor where = rays.Positions(places);
    for (int64_t i = 0; i < 30; ++i) {
      const int64_t place = batch.carrier[i].item<int64_t>() == kOtherLight ? 1 : 0;
      CHECK(torch::allclose(batch.place[i], where[place], 1e-5, 1e-5));
    }
  }
}

TEST_CASE("rays of pixels are those that tensors of cameras give, with the images' colours") {
  Scene scene = SmallScene();
  const bool distorted = GENERATE(false, true);
  INFO("distorted " << distorted);
  std::vector<Camera> cameras;
  for (const int64_t frame : scene.train) {
    Camera& camera = scene.frames[static_cast<size_t>(frame)].camera;
    if (distorted) camera.radial_distortion = {0.1, -0.02, 0}, camera.tangential_distortion = {1e-3, -2e-3};
    cameras.push_back(camera);
  }
  const TrainingRays rays(scene, scene.train, torch::kCPU);
  const int64_t all = rays.cameras().size() * 9 * 16;
  const RayTargets seen = rays.Through(torch::arange(all - 1, -1, -1, torch::kInt64));
  const torch::Tensor frame = torch::arange(all, torch::kInt64).div(9 * 16, "floor").flip(0);
  const auto grid = torch::meshgrid({torch::arange(9), torch::arange(16)}, "ij");
  const torch::Tensor pixel =
      torch::stack({grid[1], grid[0]}, -1).view({-1, 2}).repeat({rays.cameras().size(), 1}).flip(0) + 0.5;
  const Rays expected = RaysThroughPixels(StackCameras(cameras, torch::kFloat64), frame, pixel);
  CHECK(torch::equal(seen.frame, frame));
  CHECK(torch::allclose(seen.rays.origin, expected.origin.to(torch::kFloat32)));
  CHECK((seen.rays.direction - expected.direction).abs().max().item<double>() < 1e-7);
  const torch::Tensor images = scene.images.index_select(0, torch::tensor(scene.train, torch::kInt64));
  CHECK(torch::equal(seen.target, images.view({-1, 3}).flip(0).to(torch::kFloat32) / 255));
  CHECK(rays.Through(torch::empty({0}, torch::kInt64)).target.size(0) == 0);
}

TEST_CASE("rays drawn by error go where images are off, and count so that their mean is that over all pixels") {
  torch::manual_seed(3);
  const Scene scene = SmallScene();
  TrainingRays rays(scene, scene.train, torch::kCPU);
  CHECK(!rays.Sample(40).emphasis.defined());
  rays.DrawByError(0.5);
  const DepthTargets places = {torch::tensor({1}, torch::kInt64), torch::tensor({5, 2}, torch::kInt64).view({1, 2}),
                               torch::tensor({0.5F}), torch::tensor({0.01F}), torch::tensor({kStandsStill})};
  rays.SetKnownPlaces(places, 0.25, 0);
  // Off in the right half of the third image alone; what rays through known places say is not heard.
  const int64_t pixels = 4 * 9 * 16;
  RayTargets all;
  all.pixel = torch::cat({torch::arange(pixels, torch::kInt64), torch::tensor({0}, torch::kInt64)});
  all.drawn = 1;
  const torch::Tensor index = torch::arange(pixels, torch::kInt64);
  const torch::Tensor off = (index.div(144, "floor") == 2).logical_and(index % 16 >= 8);
  for (int i = 0; i < 5; ++i)
    rays.Learn(all, torch::cat({torch::where(off, torch::full({pixels}, 0.09F), torch::zeros({pixels})),
                                torch::full({1}, 1e6F)}));
  rays.errors()->Settle();
  const RayTargets batch = rays.Sample(40000);
  REQUIRE(batch.drawn == 10000);
  CHECK((batch.emphasis.slice(0, 30000) == 1).all().item<bool>());
  const torch::Tensor drawn = batch.pixel.slice(0, 0, 30000), weight = batch.emphasis.slice(0, 0, 30000);
  const torch::Tensor there = off.index_select(0, drawn).to(torch::kFloat32);
  const double share = off.to(torch::kFloat32).mean().item<double>();
  CHECK(there.mean().item<double>() > 0.4);
  CHECK((weight * there).mean().item<double>() == Approx(share).epsilon(0.03));
  CHECK(weight.mean().item<double>() == Approx(1).epsilon(0.03));
  CHECK(weight.max().item<double>() <= 2.0001);
}
