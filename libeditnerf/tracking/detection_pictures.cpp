#include "libeditnerf/tracking/detection_pictures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/palette.h"

namespace editnerf {
namespace {

constexpr int kPanelSide = 320;  // pixels of the volume's longest side
constexpr int kGap = 8;
constexpr int64_t kTrailFrames = 12;
constexpr int kSubPixelBits = 3;

cv::Scalar ColorOf(int64_t n) {
  const auto& color = KeyPointColor(n);
  return cv::Scalar(color[0], color[1], color[2]);
}

torch::Tensor ToTensor(const cv::Mat& image) {
  return torch::from_blob(image.data, {image.rows, image.cols, 3}, torch::kUInt8).clone();
}

cv::Point FixedPoint(double u, double v) {
  const double scale = 1 << kSubPixelBits;
  return {static_cast<int>(std::lround((u - 0.5) * scale)), static_cast<int>(std::lround((v - 0.5) * scale))};
}

// One projection of the volume: `right` and `up` are axes, `up_sign` -1 where the axis points down in the picture.
struct Panel {
  int64_t along, right, vertical;
  bool flipped;  // the vertical axis points up
};

cv::Mat DrawPanel(const Detection& detection, const Panel& panel, double strongest) {
  const SurfaceVolume& volume = detection.volume;
  torch::Tensor values = std::get<0>(volume.smoothed.max(panel.along));
  if (panel.right < panel.vertical) values = values.t();  // rows: vertical, columns: right
  if (panel.flipped) values = values.flip(0);
  const torch::Tensor colors = ScalarPicture(values / strongest);
  const cv::Mat cells(static_cast<int>(colors.size(0)), static_cast<int>(colors.size(1)), CV_8UC3,
                      colors.data_ptr<uint8_t>());
  const double scale = kPanelSide * volume.voxel_size / volume.LongestSide();
  const cv::Size size(std::max(1, static_cast<int>(std::lround(cells.cols * scale))),
                      std::max(1, static_cast<int>(std::lround(cells.rows * scale))));
  cv::Mat image;
  cv::resize(cells, image, size, 0, 0, cv::INTER_NEAREST);
  const auto place = [&](const Vec3& p) {
    const double cell[3] = {(p.x - volume.origin.x) / volume.voxel_size, (p.y - volume.origin.y) / volume.voxel_size,
                            (p.z - volume.origin.z) / volume.voxel_size};
    const double v = panel.flipped ? cells.rows - cell[panel.vertical] : cell[panel.vertical];
    return FixedPoint(cell[panel.right] * scale, v * scale);
  };
  for (const VolumeMaximum& candidate : detection.candidates)
    cv::circle(image, place(candidate.point), 2 << kSubPixelBits, {200, 200, 200}, cv::FILLED, cv::LINE_AA,
               kSubPixelBits);
  for (int64_t n = 0; n < detection.count(); ++n) {
    const float* p = detection.reference.data_ptr<float>() + 3 * n;
    cv::circle(image, place({p[0], p[1], p[2]}), 7 << kSubPixelBits, ColorOf(n), 2, cv::LINE_AA, kSubPixelBits);
  }
  return image;
}

// A dot, or a ring where the key point is hidden. Edged in white and black: a key point may lie on a part of its
// colour.
void DrawMarker(cv::Mat& image, const cv::Point& at, int radius, const cv::Scalar& color, bool visible) {
  const auto circle = [&](int r, const cv::Scalar& with, int thickness) {
    cv::circle(image, at, r << kSubPixelBits, with, thickness, cv::LINE_AA, kSubPixelBits);
  };
  if (!visible) {
    circle(radius, {255, 255, 255}, 3);
    circle(radius, color, 1);
    return;
  }
  circle(radius + 2, {0, 0, 0}, cv::FILLED);
  circle(radius + 1, {255, 255, 255}, cv::FILLED);
  circle(radius, color, cv::FILLED);
}

void DrawTrails(cv::Mat& image, const Scene& scene, const Detection& detection, int64_t t, int factor) {
  const int64_t count = detection.count();
  const float* tracks = detection.tracks.data_ptr<float>();
  const Camera& camera = scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(t)])].camera;
  for (int64_t n = 0; n < count; ++n) {
    cv::Point last;
    bool connected = false;
    for (int64_t s = std::max<int64_t>(0, t - kTrailFrames); s <= t; ++s) {
      const float* p = tracks + 3 * (s * count + n);
      const Projected projected = Project(camera, {p[0], p[1], p[2]});  // as this frame's camera sees the past
      const bool drawable = projected.valid && std::abs(projected.u) < 1e5 && std::abs(projected.v) < 1e5;
      const cv::Point here = FixedPoint(projected.u * factor, projected.v * factor);
      if (drawable && connected) cv::line(image, last, here, ColorOf(n), factor, cv::LINE_AA, kSubPixelBits);
      if (drawable && s == t) {
        DrawMarker(image, here, 2 + factor, ColorOf(n), detection.visible[t][n].item<bool>());
      }
      last = here;
      connected = drawable;
    }
  }
}

// `count` training frames, evenly spaced; small ones twice as large. draw(image, t, factor) adds to each.
torch::Tensor ContactSheet(const Scene& scene, int64_t count, int64_t columns,
                           const std::function<void(cv::Mat&, int64_t, int)>& draw) {
  const auto frames = static_cast<int64_t>(scene.train.size());
  count = std::clamp<int64_t>(count, 1, frames);
  columns = std::clamp<int64_t>(columns, 1, count);
  const int64_t rows = (count + columns - 1) / columns;
  const int factor = scene.width() < 240 ? 2 : 1;
  const int width = static_cast<int>(scene.width()) * factor, height = static_cast<int>(scene.height()) * factor;
  cv::Mat sheet(static_cast<int>(rows) * height, static_cast<int>(columns) * width, CV_8UC3, cv::Scalar(40, 40, 40));
  for (int64_t i = 0; i < count; ++i) {
    const int64_t t = count > 1 ? i * (frames - 1) / (count - 1) : 0;
    const torch::Tensor source = scene.images[scene.train[static_cast<size_t>(t)]].contiguous();
    const cv::Mat frame(static_cast<int>(scene.height()), static_cast<int>(scene.width()), CV_8UC3,
                        source.data_ptr<uint8_t>());
    cv::Mat image;
    cv::resize(frame, image, cv::Size(width, height), 0, 0, cv::INTER_LINEAR);
    draw(image, t, factor);
    image.copyTo(
        sheet(cv::Rect(static_cast<int>(i % columns) * width, static_cast<int>(i / columns) * height, width, height)));
  }
  return ToTensor(sheet);
}

}  // namespace

torch::Tensor VariancePicture(const Detection& detection) {
  const double strongest = std::max(detection.volume.smoothed.max().item<double>(), 1e-12);
  std::vector<cv::Mat> panels;
  for (const Panel& panel : {Panel{2, 0, 1, false}, Panel{1, 0, 2, true}, Panel{0, 1, 2, true}})
    panels.push_back(DrawPanel(detection, panel, strongest));
  int width = kGap, height = 0;
  for (const cv::Mat& panel : panels) {
    width += panel.cols + kGap;
    height = std::max(height, panel.rows + 2 * kGap);
  }
  cv::Mat sheet(height, width, CV_8UC3, cv::Scalar(40, 40, 40));
  int left = kGap;
  for (const cv::Mat& panel : panels) {
    panel.copyTo(sheet(cv::Rect(left, kGap, panel.cols, panel.rows)));
    left += panel.cols + kGap;
  }
  return ToTensor(sheet);
}

torch::Tensor TracksPicture(const Scene& scene, const Detection& detection, int64_t count, int64_t columns) {
  CheckShape(detection.tracks, {static_cast<int64_t>(scene.train.size()), kAny, 3}, "key point tracks");
  return ContactSheet(scene, count, columns,
                      [&](cv::Mat& image, int64_t t, int factor) { DrawTrails(image, scene, detection, t, factor); });
}

torch::Tensor MotionPicture(const Scene& scene, const Detection& detection, int64_t count, int64_t columns) {
  const torch::Tensor ratio = detection.motion.ratio.contiguous();
  CheckShape(ratio, {static_cast<int64_t>(scene.train.size()), kAny, kAny}, "motion evidence");
  return ContactSheet(scene, count, columns, [&](cv::Mat& image, int64_t t, int factor) {
    const cv::Mat cells(static_cast<int>(ratio.size(1)), static_cast<int>(ratio.size(2)), CV_32F,
                        ratio[t].data_ptr<float>());
    const int size = static_cast<int>(detection.motion.cell) * factor;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const float value = cells.at<float>(std::min(y / size, cells.rows - 1), std::min(x / size, cells.cols - 1));
        if (std::isnan(value)) continue;
        auto& pixel = image.at<cv::Vec3b>(y, x);
        const cv::Vec3b tint = value >= 1 ? cv::Vec3b(255, 60, 30) : cv::Vec3b(40, 120, 255);
        for (int c = 0; c < 3; ++c) pixel[c] = static_cast<uint8_t>((pixel[c] + tint[c]) / 2);
      }
    }
  });
}

}  // namespace editnerf
