#include "libeditnerf/evaluation/image_metrics.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kWindow = 11;
constexpr double kSigma = 1.5;
constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;
constexpr std::array<double, 5> kScaleWeights = {0.0448, 0.2856, 0.3001, 0.2363, 0.1333};

void CheckPair(const torch::Tensor& a, const torch::Tensor& b) {
  CheckShape(a, {kAny, kAny, 3}, "first image");
  CheckShape(b, {a.size(0), a.size(1), 3}, "second image");
}

void CheckWindowFits(const torch::Tensor& image, const char* metric) {
  if (std::min(image.size(0), image.size(1)) < kWindow) {
    Throw<ShapeError>("{} needs at least {} pixels along each side, found an image of {} x {}", metric, kWindow,
                      image.size(1), image.size(0));
  }
}

double PsnrOf(const torch::Tensor& squared_errors) {
  const double mse = squared_errors.mean().item<double>();
  const double psnr = -10 * std::log10(mse);  // +inf at 0, NaN stays NaN
  return psnr > kMaxPsnr ? kMaxPsnr : psnr;
}

torch::Tensor SquaredErrors(const torch::Tensor& a, const torch::Tensor& b) {
  return (a.to(torch::kFloat64) - b.to(torch::kFloat64)).square();
}

// [H, W, 3] -> [3, 1, H, W]: each channel an image of its own.
torch::Tensor Planes(const torch::Tensor& image) {
  return image.to(torch::kFloat64).permute({2, 0, 1}).unsqueeze(1).contiguous();
}

// Gaussian window, valid positions only; separable.
torch::Tensor Blur(const torch::Tensor& planes) {
  const auto offset = torch::arange(-(kWindow / 2), kWindow / 2 + 1, planes.options());
  auto window = torch::exp(offset.square() / (-2 * kSigma * kSigma));
  window = window / window.sum();
  return torch::conv2d(torch::conv2d(planes, window.view({1, 1, 1, kWindow})), window.view({1, 1, kWindow, 1}));
}

struct Similarity {
  torch::Tensor contrast;  // [3], mean of cs
  torch::Tensor full;      // [3], mean of l cs
};

Similarity Compare(const torch::Tensor& a, const torch::Tensor& b) {
  // The second moments are taken about 0.5, which halves the digits that the subtraction of the means costs.
  const auto ca = a - 0.5, cb = b - 0.5;
  const auto moments = Blur(torch::cat({ca, cb, ca * ca, cb * cb, ca * cb})).chunk(5);
  const auto var_a = moments[2] - moments[0].square();
  const auto var_b = moments[3] - moments[1].square();
  const auto covariance = moments[4] - moments[0] * moments[1];
  const auto mean_a = moments[0] + 0.5, mean_b = moments[1] + 0.5;
  const auto luminance = (2 * mean_a * mean_b + kC1) / (mean_a.square() + mean_b.square() + kC1);
  const auto contrast = (2 * covariance + kC2) / (var_a + var_b + kC2);
  return {contrast.mean({1, 2, 3}), (luminance * contrast).mean({1, 2, 3})};
}

torch::Tensor Halved(const torch::Tensor& planes) {
  return torch::avg_pool2d(planes, {2, 2}, {2, 2}, {0, 0}, /*ceil_mode=*/true, /*count_include_pad=*/false);
}

}  // namespace

double Psnr(const torch::Tensor& a, const torch::Tensor& b) {
  torch::NoGradGuard no_grad;
  CheckPair(a, b);
  return PsnrOf(SquaredErrors(a, b));
}

std::optional<double> MaskedPsnr(const torch::Tensor& a, const torch::Tensor& b, const torch::Tensor& mask) {
  torch::NoGradGuard no_grad;
  CheckPair(a, b);
  CheckShape(mask, {a.size(0), a.size(1)}, "mask");
  const auto chosen = SquaredErrors(a, b).index({mask.to(a.device()) != 0});
  if (chosen.numel() == 0) return std::nullopt;
  return PsnrOf(chosen);
}

double Ssim(const torch::Tensor& a, const torch::Tensor& b) {
  torch::NoGradGuard no_grad;
  CheckPair(a, b);
  CheckWindowFits(a, "SSIM");
  return Compare(Planes(a), Planes(b)).full.mean().item<double>();
}

MsSsimResult MsSsim(const torch::Tensor& a, const torch::Tensor& b) {
  torch::NoGradGuard no_grad;
  CheckPair(a, b);
  CheckWindowFits(a, "MS-SSIM");

  MsSsimResult result;
  double weight_sum = 0;
  for (int64_t side = std::min(a.size(0), a.size(1));
       side >= kWindow && result.num_scales < static_cast<int64_t>(kScaleWeights.size()); side = (side + 1) / 2) {
    weight_sum += kScaleWeights[result.num_scales++];
  }

  auto planes_a = Planes(a), planes_b = Planes(b);
  auto product = torch::ones({3}, planes_a.options());
  for (int64_t scale = 0; scale < result.num_scales; ++scale) {
    if (scale > 0) planes_a = Halved(planes_a), planes_b = Halved(planes_b);
    const Similarity similarity = Compare(planes_a, planes_b);
    const auto& mean = scale + 1 < result.num_scales ? similarity.contrast : similarity.full;
    product *= mean.clamp_min(0).pow(kScaleWeights[scale] / weight_sum);
  }
  result.value = product.mean().item<double>();
  return result;
}

}  // namespace editnerf
