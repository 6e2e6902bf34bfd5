#include "libeditnerf/imaging/encoded_image.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

std::string Encode(const torch::Tensor& image, const char* kind, const std::vector<int>& settings) {
  CheckShape(image, {kAny, kAny, 3}, "image to encode");
  if (image.scalar_type() != torch::kUInt8) Throw<ShapeError>("image to encode: expected 8-bit unsigned values");
  const torch::Tensor pixels = image.contiguous();
  const cv::Mat rgb(static_cast<int>(pixels.size(0)), static_cast<int>(pixels.size(1)), CV_8UC3,
                    pixels.data_ptr<uint8_t>());
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<uint8_t> bytes;
  if (!cv::imencode(kind, bgr, bytes, settings)) Throw<DataError>("a picture cannot be encoded as {}", kind);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

std::string EncodeJpeg(const torch::Tensor& image, int quality) {
  return Encode(image, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
}

std::string EncodePng(const torch::Tensor& image) { return Encode(image, ".png", {}); }

}  // namespace editnerf
