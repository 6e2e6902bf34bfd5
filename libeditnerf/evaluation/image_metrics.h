// How close two images are: PSNR, SSIM, MS-SSIM.
//
// Images are [H, W, 3] floating point in [0, 1], on one device; all arithmetic is in double precision. A NaN in an
// image makes the result NaN. Shapes that differ, or are not [H, W, 3], throw ShapeError.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <optional>

namespace editnerf {

// What PSNR is cut off at: the value of identical images, so that means over frames stay finite. [dB]
constexpr double kMaxPsnr = 100;

// -10 log10(mean squared error) in dB, at most kMaxPsnr.
// Anchor: a constant difference of 0.1 gives exactly 20 dB.
double Psnr(const torch::Tensor& a, const torch::Tensor& b);

// The same over the pixels where mask [H, W] (bool, or any type with "not zero" meant) is set: PSNR of what moves.
// Empty where the mask is.
std::optional<double> MaskedPsnr(const torch::Tensor& a, const torch::Tensor& b, const torch::Tensor& mask);

// Structural similarity (Wang et al., "Image quality assessment: from error visibility to structural similarity",
// 2004):
//   l = (2 mu_a mu_b + C1) / (mu_a^2 + mu_b^2 + C1)      cs = (2 sigma_ab + C2) / (sigma_a^2 + sigma_b^2 + C2)
// with C1 = 0.01^2, C2 = 0.03^2, moments under an 11 x 11 Gaussian window of sigma 1.5 at the places where the window
// lies inside the image; the mean of l cs over places and channels. 1 for identical images. Throws ShapeError when a
// side is shorter than 11 pixels.
double Ssim(const torch::Tensor& a, const torch::Tensor& b);

struct MsSsimResult {
  double value = 0;
  int64_t num_scales = 0;  // 5, or fewer where the image was too small for more
};

// Multi-scale SSIM (Wang, Simoncelli and Bovik, 2003): per channel, the product over scales of mean(cs)^w, the coarsest
// scale with mean(l cs)^w; w = 0.0448, 0.2856, 0.3001, 0.2363, 0.1333. Negative means count as 0. Each scale halves the
// last by 2 x 2 averages; where a side is odd, its last row or column is averaged alone. A scale whose shorter side is
// below 11 pixels is left out and the weights of the others are scaled to sum to 1: five scales need 161 pixels. Throws
// ShapeError when a side is shorter than 11 pixels.
MsSsimResult MsSsim(const torch::Tensor& a, const torch::Tensor& b);

}  // namespace editnerf
