#include "libeditnerf/imaging/image_file.h"

#include <algorithm>
#include <cctype>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr uintmax_t kMaxImageBytes = uintmax_t{1} << 30;

cv::Mat Decode(const std::filesystem::path& path, int flags) {
  const std::string content = ReadFile(path, kMaxImageBytes);
  cv::Mat image;
  std::string reason;
  if (!content.empty()) {
    const cv::Mat bytes(1, static_cast<int>(content.size()), CV_8U, const_cast<char*>(content.data()));
    try {
      image = cv::imdecode(bytes, flags);
    } catch (const cv::Exception& error) {
      reason = ": " + error.err;
    }
  }
  if (image.empty()) {
    Throw<DataError>("{}: cannot be decoded as an image{} ({} bytes); the file is damaged or not an image",
                     path.string(), reason, content.size());
  }
  return image;
}

// A view of an 8-bit tensor; `image` must be contiguous and stay alive.
cv::Mat View(const torch::Tensor& image) {
  const int type = image.dim() == 3 ? CV_8UC3 : CV_8UC1;
  return cv::Mat(static_cast<int>(image.size(0)), static_cast<int>(image.size(1)), type, image.data_ptr<uint8_t>());
}

torch::Tensor CheckedImage(const torch::Tensor& image, const char* name) {
  if (!image.defined() || (image.dim() != 2 && image.dim() != 3)) {
    Throw<ShapeError>("{}: expected [H, W, 3] or [H, W], found {}", name, ShapeString(image));
  }
  if (image.dim() == 3) CheckShape(image, {kAny, kAny, 3}, name);
  if (image.scalar_type() != torch::kUInt8) Throw<ShapeError>("{}: expected 8-bit unsigned values", name);
  if (image.numel() == 0) Throw<ShapeError>("{}: expected at least one pixel, found {}", name, ShapeString(image));
  return image.to(torch::kCPU).contiguous();
}

}  // namespace

torch::Tensor ReadImage(const std::filesystem::path& path) {
  const cv::Mat bgr = Decode(path, cv::IMREAD_COLOR);
  torch::Tensor image = torch::empty({bgr.rows, bgr.cols, 3}, torch::kUInt8);
  cv::Mat rgb = View(image);
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return image;
}

torch::Tensor ReadMask(const std::filesystem::path& path) {
  const cv::Mat mask = Decode(path, cv::IMREAD_UNCHANGED);
  if (mask.type() != CV_8UC1) {
    Throw<DataError>("{}: expected one channel of 8 bits, found {} channels of {} bits", path.string(), mask.channels(),
                     8 * mask.elemSize1());
  }
  torch::Tensor image = torch::empty({mask.rows, mask.cols}, torch::kUInt8);
  cv::Mat target = View(image);
  mask.copyTo(target);
  return image;
}

void WritePng(const std::filesystem::path& path, const torch::Tensor& image) {
  const torch::Tensor pixels = CheckedImage(image, "image to write");
  cv::Mat encoded = View(pixels);
  if (pixels.dim() == 3) {
    cv::Mat bgr;
    cv::cvtColor(encoded, bgr, cv::COLOR_RGB2BGR);
    encoded = bgr;
  }
  std::vector<uint8_t> bytes;
  if (!cv::imencode(".png", encoded, bytes)) Throw<DataError>("{}: the image cannot be encoded", path.string());
  WriteFileAtomically(path, std::string(bytes.begin(), bytes.end()));
}

torch::Tensor ResizeByArea(const torch::Tensor& image, int64_t new_height, int64_t new_width) {
  const torch::Tensor pixels = CheckedImage(image, "image to resize");
  if (new_height < 1 || new_width < 1)
    Throw<ShapeError>("expected a positive size, found {} x {}", new_width, new_height);
  std::vector<int64_t> sizes = pixels.sizes().vec();
  sizes[0] = new_height;
  sizes[1] = new_width;
  torch::Tensor resized = torch::empty(sizes, torch::kUInt8);
  cv::Mat target = View(resized);
  cv::resize(View(pixels), target, target.size(), 0, 0, cv::INTER_AREA);
  return resized;
}

bool HasImageExtension(const std::filesystem::path& path) {
  static const std::set<std::string> kEndings = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"};
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return kEndings.count(ending) > 0;
}

}  // namespace editnerf
