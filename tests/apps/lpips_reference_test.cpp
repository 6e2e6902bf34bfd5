// LPIPS against the values of its published program. Here, because reading the images takes OpenCV.
#include <torch/types.h>

#include <opencv2/imgcodecs.hpp>

#include "libeditnerf/evaluation/lpips.h"
#include "tests/catch.h"
#include "tests/shared_data.h"

using namespace editnerf;

namespace {

torch::Tensor ReadRgb(const std::filesystem::path& path) {
  const cv::Mat bgr = cv::imread(path.string(), cv::IMREAD_COLOR);
  REQUIRE_FALSE(bgr.empty());
  const auto pixels = torch::from_blob(bgr.data, {bgr.rows, bgr.cols, 3}, torch::kUInt8);
  return pixels.flip({2}).to(torch::kFloat32) / 255;
}

}  // namespace

TEST_CASE("LPIPS reproduces the published program's distances") {
  const auto shared = SharedData();
  if (!shared) {
    WARN("skipped: no shared data beside the checkout");
    return;
  }
  Lpips lpips =
      LoadLpips(*shared / "weights/lpips-squeeze-backbone.pth", *shared / "weights/lpips-squeeze-linear-v0.1.pth");
  const auto folder = *shared / "data/lpips";
  const auto ref = ReadRgb(folder / "ex_ref.png"), p0 = ReadRgb(folder / "ex_p0.png"),
             p1 = ReadRgb(folder / "ex_p1.png");
  CHECK(lpips->Distance(ref, p0) == Approx(0.711048).margin(1e-4));
  CHECK(lpips->Distance(ref, p1) == Approx(0.147902).margin(1e-4));
  CHECK(lpips->Distance(p0, p1) == Approx(0.727777).margin(1e-4));
}
