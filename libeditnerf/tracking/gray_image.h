// An image as OpenCV takes it.
#pragma once

#include <torch/types.h>

#include <opencv2/imgproc.hpp>

namespace editnerf {

// [H, W, 3] uint8 RGB, CPU -> CV_8UC1, a copy.
inline cv::Mat GrayImage(const torch::Tensor& image) {
  const torch::Tensor contiguous = image.contiguous();
  const cv::Mat color(static_cast<int>(image.size(0)), static_cast<int>(image.size(1)), CV_8UC3,
                      contiguous.data_ptr<uint8_t>());
  cv::Mat gray;
  cv::cvtColor(color, gray, cv::COLOR_RGB2GRAY);
  return gray;
}

}  // namespace editnerf
