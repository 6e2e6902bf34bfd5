// The colours of pictures made for looking at.
#pragma once

#include <torch/types.h>

#include <array>
#include <cstdint>

namespace editnerf {

// The colour of key point n >= 0 in all pictures, RGB. There are eight; the ninth key point has the first one's.
const std::array<uint8_t, 3>& KeyPointColor(int64_t n);

// values [H, W], from 0 (dark) to 1 (bright), clamped; NaN is 0 -> uint8 [H, W, 3] on the CPU, the colour map
// "inferno".
torch::Tensor ScalarPicture(const torch::Tensor& values);

}  // namespace editnerf
