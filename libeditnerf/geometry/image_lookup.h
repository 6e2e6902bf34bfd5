// Bilinear look-ups in images, depth maps and flow fields, with validity.
#pragma once

#include <torch/types.h>

namespace editnerf {

struct LookedUp {
  torch::Tensor value;  // [P, C]; 0 where invalid
  torch::Tensor valid;  // [P] bool
};

// image [F, H, W, C] or [F, H, W] (C = 1), floating point; frame [P] int64; pixel [P, 2] positions (u, v), whose
// centres lie at +0.5: the value of the image at (j + 0.5, i + 0.5) is image[f, i, j].
//
// Valid are positions with 0 <= u <= W and 0 <= v <= H whose four neighbours are all finite (also those of weight zero,
// without which there is no gradient); in the outer half pixel the image continues with its border. Differentiable in
// `pixel` and `image`; gradients are finite even where neighbours, or the position itself, are not. Throws ShapeError.
LookedUp BilinearLookUp(const torch::Tensor& image, const torch::Tensor& frame, const torch::Tensor& pixel);

}  // namespace editnerf
