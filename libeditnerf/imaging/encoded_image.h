// Pictures as the bytes of an image file, for sending them somewhere.
#pragma once

#include <torch/types.h>

#include <string>

namespace editnerf {

// uint8 [H, W, 3], RGB, on the CPU. quality from 1 to 100. Throws ShapeError, or DataError where encoding fails.
std::string EncodeJpeg(const torch::Tensor& image, int quality);

// Without loss.
std::string EncodePng(const torch::Tensor& image);

}  // namespace editnerf
