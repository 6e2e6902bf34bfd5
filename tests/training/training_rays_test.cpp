#include "libeditnerf/training/training_rays.h"

#include <torch/torch.h>

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

TEST_CASE("a share of the rays goes through places that stand still, from shortly before them on") {
  torch::manual_seed(1);
  const Scene scene = SmallScene();
  TrainingRays rays(scene, scene.train, torch::kCPU);
  CHECK(rays.Sample(40).still == 0);
  CHECK(!rays.Sample(40).start.defined());
  rays.SetStillPlaces({}, 0.5);
  CHECK(rays.Sample(40).still == 0);
  const DepthTargets places = {torch::tensor({1, 3}, torch::kInt64),
                               torch::tensor({5, 2, 11, 7}, torch::kInt64).view({2, 2}), torch::tensor({0.5F, 0.7F}),
                               torch::tensor({0.01F, 0.01F})};
  rays.SetStillPlaces(places, 0.25);
  const RayTargets batch = rays.Sample(40);
  REQUIRE(batch.still == 10);
  CHECK((batch.start.slice(0, 0, 30) == 0).all().item<bool>());
  for (int64_t i = 30; i < 40; ++i) {
    const bool first = batch.frame[i].item<int64_t>() == 1;
    CHECK((first || batch.frame[i].item<int64_t>() == 3));
    CHECK(batch.start[i].item<float>() == Approx(first ? 0.45 : 0.63));
    const torch::Tensor color = first ? scene.images[scene.train[1]][2][5] : scene.images[scene.train[3]][7][11];
    CHECK(torch::allclose(batch.target[i], color.to(torch::kFloat32) / 255));
  }
}
