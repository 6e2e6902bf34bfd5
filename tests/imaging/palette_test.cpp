#include "libeditnerf/imaging/palette.h"

#include <torch/types.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("eight key points have colours of their own, and the ninth has the first one's") {
  for (int64_t n = 0; n < 8; ++n) {
    for (int64_t m = 0; m < n; ++m) CHECK(KeyPointColor(n) != KeyPointColor(m));
  }
  CHECK(KeyPointColor(8) == KeyPointColor(0));
}

TEST_CASE("a scalar picture grows brighter with its values") {
  const torch::Tensor picture = ScalarPicture(torch::linspace(0, 1, 32).view({1, 32}));
  CHECK(picture.sizes() == torch::IntArrayRef({1, 32, 3}));
  const torch::Tensor luminance = picture[0].to(torch::kFloat32).matmul(torch::tensor({0.2126f, 0.7152f, 0.0722f}));
  CHECK((luminance.slice(0, 1) > luminance.slice(0, 0, -1)).all().item<bool>());
  CHECK(luminance[0].item<double>() < 5);
  CHECK(luminance[31].item<double>() > 240);
}

TEST_CASE("a scalar picture clamps its values and shows NaN as dark") {
  const torch::Tensor picture =
      ScalarPicture(torch::tensor({{0.0, -3.0, double{NAN}, -double{INFINITY}}, {1.0, 2.0, 1e9, double{INFINITY}}}));
  CHECK(picture.scalar_type() == torch::kUInt8);
  for (int64_t row = 0; row < 2; ++row) {
    for (int64_t column = 1; column < 4; ++column) CHECK(torch::equal(picture[row][column], picture[row][0]));
  }
  CHECK_THROWS_AS(ScalarPicture(torch::zeros({2, 2, 3})), ShapeError);
}
