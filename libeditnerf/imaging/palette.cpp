#include "libeditnerf/imaging/palette.h"

#include <opencv2/imgproc.hpp>

#include "libeditnerf/base/shape.h"

namespace editnerf {

const std::array<uint8_t, 3>& KeyPointColor(int64_t n) {
  static const std::array<std::array<uint8_t, 3>, 8> colors = {{{255, 70, 60},
                                                                {70, 200, 255},
                                                                {255, 210, 50},
                                                                {90, 255, 110},
                                                                {255, 110, 240},
                                                                {255, 150, 50},
                                                                {140, 130, 255},
                                                                {255, 255, 255}}};
  return colors[static_cast<size_t>(n) % colors.size()];
}

torch::Tensor ScalarPicture(const torch::Tensor& values) {
  CheckShape(values, {kAny, kAny}, "values of a picture");
  auto brightness = values.detach().to(torch::kCPU, torch::kFloat64) * 255;
  brightness = brightness.round().clamp(0, 255).nan_to_num(0).to(torch::kUInt8).contiguous();
  const cv::Mat gray(static_cast<int>(values.size(0)), static_cast<int>(values.size(1)), CV_8UC1,
                     brightness.data_ptr<uint8_t>());
  cv::Mat picture;
  cv::applyColorMap(gray, picture, cv::COLORMAP_INFERNO);
  cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  return torch::from_blob(picture.data, {values.size(0), values.size(1), 3}, torch::kUInt8).clone();
}

}  // namespace editnerf
