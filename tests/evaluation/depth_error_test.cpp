#include "libeditnerf/evaluation/depth_error.h"

#include <torch/types.h>

#include <limits>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// Two frames of 2 x 10 pixels, the second row of each on an object; only the second frame is for training.
Scene TwoParts() {
  Scene scene;
  scene.name = "parts";
  scene.frames.resize(2);
  scene.train = {1};
  GroundTruth truth;
  truth.objects = {"lid"};
  truth.depth = torch::full({2, 2, 10}, 2.0F);
  truth.depth[1][0][0] = std::numeric_limits<float>::infinity();
  truth.mask = torch::zeros({2, 2, 10}, torch::kUInt8);
  truth.mask.select(1, 1).fill_(1);
  scene.truth = truth;
  return scene;
}

}  // namespace

TEST_CASE("depth errors are measured for each part, relative to the true depth") {
  auto depth = torch::full({1, 2, 10}, 2.0F);
  depth[0][1].fill_(2.2F);
  depth[0][1][3] = std::numeric_limits<float>::quiet_NaN();
  depth[0][1][4] = 0.0F;
  const auto errors = MeasureDepthErrors(depth, TwoParts(), {0});
  REQUIRE(errors.size() == 2);
  CHECK(errors[0].part == "static");
  CHECK(errors[0].pixels == 9);
  CHECK(errors[0].percentile90 == 0);
  CHECK(errors[1].part == "lid");
  CHECK(errors[1].pixels == 10);
  CHECK(errors[1].median == Approx(0.1).epsilon(1e-5));
  CHECK(errors[1].percentile90 == 1);  // the pixel without a surface
}

TEST_CASE("depth errors of some pixels are those of the middle ones of whole squares") {
  Scene scene = TwoParts();
  GroundTruth& truth = *scene.truth;
  truth.depth = torch::full({2, 4, 8}, 2.0F);
  truth.mask = torch::zeros({2, 4, 8}, torch::kUInt8);
  truth.mask[1][1][4] = 1;  // in the middle of the second of two squares of 3 x 3 pixels
  truth.depth[1][1][4] = 4.0F;
  const auto errors = MeasureDepthErrors(torch::tensor({2.0F, 5.0F}).view({1, 1, 2}), scene, {0}, 3);
  REQUIRE(errors.size() == 2);
  CHECK(errors[0].pixels == 1);
  CHECK(errors[0].median == 0);
  CHECK(errors[1].pixels == 1);
  CHECK(errors[1].median == Approx(0.25));
}

TEST_CASE("depth errors take ground truth of the right size") {
  Scene scene = TwoParts();
  CHECK_THROWS_AS(MeasureDepthErrors(torch::zeros({2, 2, 10}), scene, {0}), ShapeError);
  scene.truth.reset();
  CHECK_THROWS_AS(MeasureDepthErrors(torch::zeros({1, 2, 10}), scene, {0}), DataError);
}
