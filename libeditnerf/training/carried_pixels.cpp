#include "libeditnerf/training/carried_pixels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libeditnerf/scene/timeline.h"

namespace editnerf {
namespace {

constexpr int64_t kShareOfWidth = 80;

Vec3 RowOf(const torch::TensorAccessor<double, 2>& rows, int64_t row) {
  return {rows[row][0], rows[row][1], rows[row][2]};
}

// Marks the pixels around a pixel position in an image of marks.
void MarkAround(double u, double v, int64_t reach, int64_t height, int64_t width, uint8_t* marks) {
  if (!(u >= 0 && u < static_cast<double>(width) && v >= 0 && v < static_cast<double>(height))) return;
  const auto column = static_cast<int64_t>(u), row = static_cast<int64_t>(v);
  const int64_t left = std::max<int64_t>(0, column - reach), right = std::min(width, column + reach + 1);
  for (int64_t y = std::max<int64_t>(0, row - reach); y < std::min(height, row + reach + 1); ++y)
    std::fill(marks + y * width + left, marks + y * width + right, uint8_t{1});
}

}  // namespace

torch::Tensor CarriedPixels(const Scene& scene, const DepthTargets& places, const torch::Tensor& tracks) {
  if (places.size() == 0) return torch::empty({0}, torch::kInt64);
  const auto val_frames = static_cast<int64_t>(scene.val.size());
  const int64_t height = scene.height(), width = scene.width();
  const int64_t reach = std::max<int64_t>(1, width / kShareOfWidth);
  const torch::Tensor marks = torch::zeros({val_frames, height, width}, torch::kUInt8);
  const torch::Tensor path = tracks.to(torch::kFloat64).contiguous();
  for (int64_t i = 0; i < val_frames; ++i) {
    const int64_t val = scene.val[static_cast<size_t>(i)];
    const TimelinePosition at = LocateInTime(scene, val);
    const Camera& seen_by = scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(at.before)])].camera;
    const torch::Tensor moved = at.weight * (path[at.after] - path[at.before]);
    const auto move = moved.accessor<double, 2>();
    const torch::Tensor rows = (places.frame == at.before).logical_and(places.key_point >= 0).nonzero().squeeze(1);
    const auto row = rows.accessor<int64_t, 1>();
    for (int64_t r = 0; r < rows.size(0); ++r) {
      const int64_t* const pixel = places.pixel.data_ptr<int64_t>() + 2 * row[r];
      const Vec3 direction =
          seen_by.DirectionThrough(static_cast<double>(pixel[0]) + 0.5, static_cast<double>(pixel[1]) + 0.5);
      const double distance = places.distance.data_ptr<float>()[row[r]];
      const Vec3 point =
          seen_by.position + direction * distance + RowOf(move, places.key_point.data_ptr<int64_t>()[row[r]]);
      const Projected seen = Project(scene.frames[static_cast<size_t>(val)].camera, point);
      if (seen.valid) MarkAround(seen.u, seen.v, reach, height, width, marks[i].data_ptr<uint8_t>());
    }
  }
  return marks.flatten().nonzero().squeeze(1);
}

}  // namespace editnerf
