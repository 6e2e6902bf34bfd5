#include "libeditnerf/tracking/raft/correlation.h"

#include <torch/types.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kLargestRadius = 4;
constexpr int64_t kPlacesPerPart = 64;

// All samples of a window lie at the same fraction between pixels, so that one patch of (2 r + 2)^2 values gives them.
class Window {
 public:
  explicit Window(int64_t radius) : radius_(radius), side_(2 * radius + 2) {}

  // The samples around (x, y) of a map [height, width], `stride` apart, those of one column after the other.
  void Sample(const float* map, int64_t height, int64_t width, float x, float y, float* out, int64_t stride) {
    // A flow that has run away, or is not a number, must not overflow the integers.
    const float limit = 1e6F;
    const float left = std::floor(std::clamp(x, -limit, limit)), top = std::floor(std::clamp(y, -limit, limit));
    const float fx = x - left, fy = y - top;
    const int64_t column = static_cast<int64_t>(std::isfinite(left) ? left : -limit) - radius_;
    const int64_t row = static_cast<int64_t>(std::isfinite(top) ? top : -limit) - radius_;
    for (int64_t i = 0; i < side_; ++i) {
      float* line = patch_.data() + i * side_;
      const bool inside = row + i >= 0 && row + i < height;
      for (int64_t j = 0; j < side_; ++j) {
        line[j] = inside && column + j >= 0 && column + j < width ? map[(row + i) * width + column + j] : 0.0F;
      }
    }
    for (int64_t j = 0; j + 1 < side_; ++j) {
      for (int64_t i = 0; i + 1 < side_; ++i, out += stride) {
        const float* corner = patch_.data() + i * side_ + j;
        const float upper = corner[0] + fx * (corner[1] - corner[0]);
        const float lower = corner[side_] + fx * (corner[side_ + 1] - corner[side_]);
        *out = upper + fy * (lower - upper);
      }
    }
  }

 private:
  static constexpr int64_t kLargestSide = 2 * kLargestRadius + 2;
  int64_t radius_, side_;
  std::array<float, kLargestSide * kLargestSide> patch_{};
};

}  // namespace

RaftCorrelation::RaftCorrelation(const torch::Tensor& from, const torch::Tensor& to, int64_t radius) : radius_(radius) {
  CheckShape(from, {kAny, kAny, kAny, kAny}, "features of the first image");
  CheckShape(to, {from.size(0), from.size(1), from.size(2), from.size(3)}, "features of the second image");
  TORCH_CHECK(radius >= 0 && radius <= kLargestRadius, "RAFT correlation: radius ", radius);
  height_ = from.size(2);
  width_ = from.size(3);
  const torch::Tensor scaled = from.flatten(2).transpose(1, 2) / std::sqrt(static_cast<double>(from.size(1)));
  levels_.push_back(torch::matmul(scaled, to.flatten(2)).view({from.size(0), height_ * width_, height_, width_}));
  for (int64_t level = 1; level < kLevels; ++level) {
    const torch::Tensor& finer = levels_.back();
    if (std::min(finer.size(2), finer.size(3)) < 2) break;
    levels_.push_back(torch::avg_pool2d(finer, 2));
  }
}

torch::Tensor RaftCorrelation::Lookup(const torch::Tensor& places) const {
  const int64_t batch = levels_[0].size(0), count = height_ * width_, side = 2 * radius_ + 1, window = side * side;
  CheckShape(places, {batch, 2, height_, width_}, "places");
  const torch::Tensor at = places.contiguous();
  torch::Tensor samples = torch::zeros({batch, kLevels * window, height_, width_}, places.options());
  const float* x = at.data_ptr<float>();
  float* out = samples.data_ptr<float>();
  ParallelFor(batch * count, kPlacesPerPart, [&](int64_t begin, int64_t end) {
    Window around(radius_);
    for (int64_t i = begin; i < end; ++i) {
      const int64_t image = i / count, place = i % count;
      const float* own = x + image * 2 * count + place;
      for (size_t level = 0; level < levels_.size(); ++level) {
        const torch::Tensor& map = levels_[level];
        const float scale = 1.0F / static_cast<float>(int64_t{1} << level);
        around.Sample(map.data_ptr<float>() + i * map.size(2) * map.size(3), map.size(2), map.size(3), own[0] * scale,
                      own[count] * scale,
                      out + (image * kLevels + static_cast<int64_t>(level)) * window * count + place, count);
      }
    }
  });
  return samples;
}

}  // namespace editnerf
