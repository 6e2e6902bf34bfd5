// Comparing what images show around pixels.
#pragma once

#include <torch/types.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"

namespace editnerf {

// A picture to be read at many places. gray [H, W] float32 contiguous, not held on to.
class GreyImage {
 public:
  explicit GreyImage(const torch::Tensor& gray)
      : values_(gray.data_ptr<float>()), height_(gray.size(0)), width_(gray.size(1)) {}

  // Bilinear; beyond the outer pixels' centres the edge goes on.
  double At(const Pixel& p) const {
    const double x = std::clamp(p.u - 0.5, 0.0, static_cast<double>(width_ - 1));
    const double y = std::clamp(p.v - 0.5, 0.0, static_cast<double>(height_ - 1));
    const auto column = std::min(static_cast<int64_t>(x), width_ - 2);
    const auto row = std::min(static_cast<int64_t>(y), height_ - 2);
    const double fx = x - static_cast<double>(column), fy = y - static_cast<double>(row);
    const float* const at = values_ + row * width_ + column;
    return (1 - fy) * ((1 - fx) * at[0] + fx * at[1]) + fy * ((1 - fx) * at[width_] + fx * at[width_ + 1]);
  }

 private:
  const float* values_;
  int64_t height_, width_;
};

// Zero-mean normalised correlation of the patches around two positions, in [-1, 1]; 0 where a patch leaves its image.
// A patch without texture has nothing to compare and scores 0. gray [H, W] float32 contiguous.
double PatchSimilarity(const torch::Tensor& gray_a, const Pixel& a, const torch::Tensor& gray_b, const Pixel& b,
                       int64_t radius);

// The patch around a pixel of frame t, every one of its pixels carried along by the flow: it may turn and shrink, but
// goes on to look the same.
class CarriedPatch {
 public:
  CarriedPatch(const Clip& clip, int64_t t, const Pixel& center, int64_t radius);

  void Carry(int64_t t, int64_t step);  // from frame t to t + step, 1 or -1

  // Correlation of what the patch was and what frame t shows where it is now.
  double Similarity(int64_t t) const;

 private:
  const Clip& clip_;
  std::vector<Pixel> pixels_;
  std::vector<double> before_;
};

}  // namespace editnerf
