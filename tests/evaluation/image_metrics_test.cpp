#include "libeditnerf/evaluation/image_metrics.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>
#include <vector>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

torch::Tensor SmoothImage(int64_t height, int64_t width) {
  const auto y = torch::linspace(0, 9, height).view({height, 1, 1});
  const auto x = torch::linspace(0, 13, width).view({1, width, 1});
  const auto channel = torch::tensor({0.0f, 1.1f, 2.3f}).view({1, 1, 3});
  return 0.5 + 0.25 * torch::sin(x + channel) + 0.2 * torch::cos(y * 1.3 - channel);
}

torch::Tensor Noisy(const torch::Tensor& image, double sigma, uint64_t seed = 1) {
  torch::manual_seed(seed);
  return (image + sigma * torch::randn_like(image)).clamp(0, 1);
}

// One scale of one channel by plain loops: {mean of cs, mean of l cs}.
std::pair<double, double> LoopSimilarity(const std::vector<double>& a, const std::vector<double>& b, int64_t height,
                                         int64_t width) {
  double kernel[11][11], sum = 0;
  for (int i = 0; i < 11; ++i)
    for (int j = 0; j < 11; ++j) sum += kernel[i][j] = std::exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / 4.5);
  double contrast = 0, full = 0;
  for (int64_t y = 0; y + 11 <= height; ++y) {
    for (int64_t x = 0; x + 11 <= width; ++x) {
      double mean_a = 0, mean_b = 0, var_a = 0, var_b = 0, cov = 0;
      for (int pass = 0; pass < 2; ++pass) {
        for (int i = 0; i < 11; ++i) {
          for (int j = 0; j < 11; ++j) {
            const double w = kernel[i][j] / sum, va = a[(y + i) * width + x + j], vb = b[(y + i) * width + x + j];
            if (pass == 0) {
              mean_a += w * va, mean_b += w * vb;
            } else {
              var_a += w * (va - mean_a) * (va - mean_a);
              var_b += w * (vb - mean_b) * (vb - mean_b);
              cov += w * (va - mean_a) * (vb - mean_b);
            }
          }
        }
      }
      const double cs = (2 * cov + 9e-4) / (var_a + var_b + 9e-4);
      contrast += cs;
      full += cs * (2 * mean_a * mean_b + 1e-4) / (mean_a * mean_a + mean_b * mean_b + 1e-4);
    }
  }
  const double places = static_cast<double>((height - 10) * (width - 10));
  return {contrast / places, full / places};
}

std::vector<double> Channel(const torch::Tensor& image, int64_t channel) {
  const auto plane = image.select(2, channel).to(torch::kFloat64).contiguous();
  return {plane.data_ptr<double>(), plane.data_ptr<double>() + plane.numel()};
}

std::vector<double> LoopHalved(const std::vector<double>& image, int64_t height, int64_t width) {
  std::vector<double> half;
  for (int64_t y = 0; y < height; y += 2) {
    for (int64_t x = 0; x < width; x += 2) {
      const int64_t y2 = std::min(y + 1, height - 1), x2 = std::min(x + 1, width - 1);
      half.push_back((image[y * width + x] + image[y2 * width + x] + image[y * width + x2] + image[y2 * width + x2]) /
                     4);
    }
  }
  return half;
}

}  // namespace

TEST_CASE("PSNR of a constant difference is its known value") {
  const auto a = torch::full({8, 6, 3}, 0.25, torch::kFloat64);
  CHECK(Psnr(a, a + 0.1) == Approx(20).margin(1e-9));
  CHECK(Psnr(a, a - 0.01) == Approx(40).margin(1e-9));
  CHECK(Psnr(a.to(torch::kFloat32), (a + 0.1).to(torch::kFloat32)) == Approx(20).margin(1e-5));
}

TEST_CASE("PSNR of identical images is the documented maximum, and NaN is not hidden") {
  const auto a = SmoothImage(12, 15);
  CHECK(Psnr(a, a) == kMaxPsnr);
  CHECK(Psnr(a, a.to(torch::kFloat64) + 1e-7) == kMaxPsnr);
  auto broken = a.clone();
  broken[3][4][1] = std::numeric_limits<float>::quiet_NaN();
  CHECK(std::isnan(Psnr(a, broken)));
}

TEST_CASE("PSNR of Gaussian noise is minus twenty log of its sigma") {
  torch::manual_seed(5);
  const auto a = torch::full({200, 300, 3}, 0.5);
  CHECK(Psnr(a, a + 0.05 * torch::randn_like(a)) == Approx(-20 * std::log10(0.05)).margin(0.05));
}

TEST_CASE("masked PSNR sees the masked pixels alone") {
  const auto a = torch::full({4, 4, 3}, 0.5, torch::kFloat64);
  auto b = a.clone();
  b.slice(0, 0, 2) += 0.1;
  b.slice(0, 2, 4) += 0.5;
  auto mask = torch::zeros({4, 4}, torch::kUInt8);
  mask.slice(0, 0, 2) = 2;
  CHECK(MaskedPsnr(a, b, mask).value() == Approx(20).margin(1e-9));
  CHECK(MaskedPsnr(a, b, torch::ones({4, 4}, torch::kBool)).value() == Approx(Psnr(a, b)));
  CHECK_FALSE(MaskedPsnr(a, b, torch::zeros({4, 4}, torch::kBool)).has_value());
  CHECK_THROWS_WITH(MaskedPsnr(a, b, torch::zeros({4, 5})), "mask: expected shape [4, 4], found [4, 5]");
}

TEST_CASE("all image metrics are symmetric and best for identical images") {
  const auto a = SmoothImage(48, 60), b = Noisy(a, 0.1);
  CHECK(Psnr(a, b) == Psnr(b, a));
  CHECK(Ssim(a, b) == Approx(Ssim(b, a)).epsilon(1e-12));
  CHECK(MsSsim(a, b).value == Approx(MsSsim(b, a).value).epsilon(1e-12));
  CHECK(Ssim(a, a) == Approx(1).margin(1e-12));
  CHECK(MsSsim(a, a).value == Approx(1).margin(1e-12));
  CHECK(Ssim(a, b) < 0.95);
}

TEST_CASE("SSIM of constant images is their luminance term") {
  const auto a = torch::full({11, 11, 3}, 0.2, torch::kFloat64), b = torch::full({11, 11, 3}, 0.6, torch::kFloat64);
  CHECK(Ssim(a, b) == Approx((2 * 0.2 * 0.6 + 1e-4) / (0.04 + 0.36 + 1e-4)).epsilon(1e-10));
}

TEST_CASE("SSIM equals a plain loop over windows") {
  const auto a = SmoothImage(17, 23), b = Noisy(a, 0.08);
  double expected = 0;
  for (int64_t c = 0; c < 3; ++c) expected += LoopSimilarity(Channel(a, c), Channel(b, c), 17, 23).second / 3;
  CHECK(Ssim(a, b) == Approx(expected).epsilon(1e-10));
}

TEST_CASE("MS-SSIM with fewer scales equals plain loops with weights that sum to one") {
  // 29 x 45 -> 15 x 23 -> 8: two scales.
  const auto a = SmoothImage(29, 45), b = Noisy(a, 0.08);
  double expected = 0;
  for (int64_t c = 0; c < 3; ++c) {
    const auto va = Channel(a, c), vb = Channel(b, c);
    const double fine = LoopSimilarity(va, vb, 29, 45).first;
    const double coarse = LoopSimilarity(LoopHalved(va, 29, 45), LoopHalved(vb, 29, 45), 15, 23).second;
    const double sum = 0.0448 + 0.2856;
    expected += std::pow(fine, 0.0448 / sum) * std::pow(coarse, 0.2856 / sum) / 3;
  }
  const MsSsimResult result = MsSsim(a, b);
  CHECK(result.num_scales == 2);
  CHECK(result.value == Approx(expected).epsilon(1e-10));
}

TEST_CASE("MS-SSIM uses five scales from 161 pixels on") {
  const auto a = torch::rand({161, 170, 3});
  CHECK(MsSsim(a, a).num_scales == 5);
  CHECK(MsSsim(a.slice(0, 0, 160), a.slice(0, 0, 160)).num_scales == 4);
  CHECK(MsSsim(a.slice(0, 0, 11), a.slice(0, 0, 11)).num_scales == 1);
}

TEST_CASE("MS-SSIM falls with noise and with blur") {
  const auto a = Noisy(SmoothImage(90, 100), 0.15, 3);
  double last = 1;
  for (const double sigma : {0.02, 0.05, 0.1, 0.2}) {
    const double value = MsSsim(a, Noisy(a, sigma, 7)).value;
    CHECK(value < last);
    last = value;
  }
  last = 1;
  for (const int64_t size : {3, 5, 9}) {
    const auto blurred =
        torch::avg_pool2d(a.permute({2, 0, 1}), {size, size}, {1, 1}, {size / 2, size / 2}, false, false);
    const double value = MsSsim(a, blurred.permute({1, 2, 0})).value;
    CHECK(value < last);
    last = value;
  }
}

TEST_CASE("image metrics refuse shapes that do not match and images that are too small") {
  const auto a = torch::zeros({12, 14, 3});
  CHECK_THROWS_WITH(Psnr(a, torch::zeros({12, 13, 3})), "second image: expected shape [12, 14, 3], found [12, 13, 3]");
  CHECK_THROWS_WITH(Ssim(torch::zeros({3, 12, 14}), a), "first image: expected shape [*, *, 3], found [3, 12, 14]");
  const auto small = torch::zeros({10, 14, 3});
  CHECK_THROWS_WITH(Ssim(small, small), "SSIM needs at least 11 pixels along each side, found an image of 14 x 10");
  CHECK_THROWS_AS(MsSsim(small, small), ShapeError);
}
