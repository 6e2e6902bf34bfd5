// Comparing what images show around pixels.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"

namespace editnerf {

// Bilinear; beyond the outer pixels' centres the edge goes on. gray [H, W] float32 contiguous.
double GreyAt(const torch::Tensor& gray, const Pixel& p);

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
