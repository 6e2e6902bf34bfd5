#include "libeditnerf/geometry/image_lookup.h"

#include <torch/types.h>

#include <limits>

#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

LookedUp LookUpAt(const torch::Tensor& image, double u, double v) {
  return BilinearLookUp(image, torch::zeros({1}, torch::kInt64), torch::tensor({{u, v}}, image.dtype()));
}

}  // namespace

TEST_CASE("look-ups return the image at pixel centres and its bilinear blend between them") {
  const auto image = torch::rand({2, 4, 5, 3}, torch::kFloat64);
  const auto frame = torch::tensor({1, 0, 1}, torch::kInt64);
  const auto pixel = torch::tensor({{2.5, 1.5}, {4.5, 3.5}, {2.75, 1.9}}, torch::kFloat64);
  const LookedUp found = BilinearLookUp(image, frame, pixel);
  CHECK(found.valid.all().item<bool>());
  CHECK(found.value[0].allclose(image[1][1][2]));
  CHECK(found.value[1].allclose(image[0][3][4]));
  const auto blend =
      0.6 * (0.75 * image[1][1][2] + 0.25 * image[1][1][3]) + 0.4 * (0.75 * image[1][2][2] + 0.25 * image[1][2][3]);
  CHECK(found.value[2].allclose(blend));
}

TEST_CASE("a look-up reproduces a linear image away from the border, without truncation of positions") {
  const auto column = torch::arange(8, torch::kFloat64) + 0.5, row = torch::arange(6, torch::kFloat64) + 0.5;
  const auto image = (3 * column.unsqueeze(0) - 2 * row.unsqueeze(1)).unsqueeze(0);
  const auto pixel = Leaf(0.5 + torch::rand({20, 2}, torch::kFloat64) * torch::tensor({7.0, 5.0}, torch::kFloat64));
  const auto look = [&] { return BilinearLookUp(image, torch::zeros({20}, torch::kInt64), pixel).value; };
  CHECK(look().squeeze(-1).allclose(3 * pixel.select(1, 0) - 2 * pixel.select(1, 1)));
  CHECK(GradientError(look, {pixel}) < 1e-7);
}

TEST_CASE("the outer half pixel continues the border, and nothing lies beyond") {
  const auto image = torch::rand({1, 3, 3}, torch::kFloat64);
  CHECK(LookUpAt(image, 0, 0).value.item<double>() == image[0][0][0].item<double>());
  CHECK(LookUpAt(image, 3, 3).value.item<double>() == image[0][2][2].item<double>());
  CHECK(LookUpAt(image, 3, 3).valid.item<bool>());
  for (const auto& [u, v] : {std::pair{-1e-3, 1.0}, std::pair{1.0, 3.001}, std::pair{1e30, 1.0},
                             std::pair{std::numeric_limits<double>::quiet_NaN(), 1.0},
                             std::pair{-std::numeric_limits<double>::infinity(), 1.0}}) {
    const LookedUp found = LookUpAt(image, u, v);
    CHECK_FALSE(found.valid.item<bool>());
    CHECK(found.value.item<double>() == 0);
  }
  CHECK(LookUpAt(torch::full({1, 1, 1}, 7.0), 0.2, 0.9).value.item<double>() == 7);
}

TEST_CASE("a look-up beside NaN or infinity is invalid and its gradients are finite") {
  auto image = torch::rand({1, 4, 4, 2});
  image[0][1][1][1] = std::numeric_limits<float>::quiet_NaN();
  image[0][3][3][0] = std::numeric_limits<float>::infinity();
  auto pixel = torch::tensor({{1.2, 1.3}, {3.4, 3.4}, {3.2, 0.8}, {std::numeric_limits<double>::quiet_NaN(), 2.0}},
                             torch::kFloat32)
                   .set_requires_grad(true);
  const LookedUp found = BilinearLookUp(image, torch::zeros({4}, torch::kInt64), pixel);
  CHECK(found.valid.equal(torch::tensor({false, false, true, false})));
  CHECK(found.value.isfinite().all().item<bool>());
  found.value.sum().backward();
  CHECK(pixel.grad().isfinite().all().item<bool>());
}

TEST_CASE("look-ups refuse wrong shapes and integer images") {
  const auto frame = torch::zeros({2}, torch::kInt64);
  CHECK_THROWS_WITH(BilinearLookUp(torch::zeros({4, 4}), frame, torch::zeros({2, 2})),
                    "image: expected shape [*, *, *, *], found [4, 4]");
  CHECK_THROWS_WITH(BilinearLookUp(torch::zeros({1, 4, 4}), frame, torch::zeros({3, 2})),
                    "pixel: expected shape [2, 2], found [3, 2]");
  CHECK_THROWS_WITH(BilinearLookUp(torch::zeros({1, 4, 4}, torch::kUInt8), frame, torch::zeros({2, 2})),
                    "image: expected floating-point values");
}
