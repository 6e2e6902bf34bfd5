#include "libeditnerf/editing/key_point_tracks.h"

#include <torch/types.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/field/key_points.h"
#include "libeditnerf/geometry/box.h"

namespace editnerf {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void Include(const Vec3& point, Box* box) {
  box->low = {std::min(box->low.x, point.x), std::min(box->low.y, point.y), std::min(box->low.z, point.z)};
  box->high = {std::max(box->high.x, point.x), std::max(box->high.y, point.y), std::max(box->high.z, point.z)};
}

Box NoBox() { return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}}; }

}  // namespace

KeyPointTracks::KeyPointTracks(const torch::Tensor& tracks) {
  CheckShape(tracks, {kAny, kAny, 3}, "key point tracks");
  if (tracks.size(0) < 1) Throw<ShapeError>("key point tracks: expected at least one frame, found none");
  const auto known = tracks.detach().to(torch::kCPU, torch::kFloat64).contiguous();
  const auto at = known.accessor<double, 3>();
  for (int64_t t = 0; t < known.size(0); ++t) {
    rows_.emplace_back();
    for (int64_t n = 0; n < known.size(1); ++n) rows_.back().push_back({at[t][n][0], at[t][n][1], at[t][n][2]});
  }
}

Vec3 KeyPointTracks::Center() const {
  if (num_key_points() == 0) return {};
  Box box = NoBox();
  for (const auto& row : rows_) {
    for (const Vec3& point : row) Include(point, &box);
  }
  return box.Center();
}

double KeyPointTracks::Extent(int64_t key_point) const {
  Box box = NoBox();
  for (const auto& row : rows_) Include(row[static_cast<size_t>(key_point)], &box);
  return box.LongestSide();
}

std::optional<double> KeyPointTracks::DragDepth(const Camera& camera, int64_t key_point, double u, double v,
                                                int64_t count) const {
  std::vector<std::pair<double, double>> found;  // squared distance in the image, depth
  for (const auto& row : rows_) {
    const Projected seen = Project(camera, row[static_cast<size_t>(key_point)]);
    if (seen.valid) found.emplace_back((seen.u - u) * (seen.u - u) + (seen.v - v) * (seen.v - v), seen.depth);
  }
  if (found.empty()) return std::nullopt;
  const size_t nearest = std::min(found.size(), static_cast<size_t>(std::max<int64_t>(count, 1)));
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(nearest), found.end());
  double sum = 0;
  for (size_t i = 0; i < nearest; ++i) sum += found[i].second;
  return sum / static_cast<double>(nearest);
}

Reach KeyPointTracks::ReachOf(int64_t key_point, const Vec3& position) const {
  Reach reach;
  reach.distance = kInfinity;
  for (const auto& row : rows_) {
    reach.distance = std::min(reach.distance, Norm(row[static_cast<size_t>(key_point)] - position));
  }
  reach.share = reach.distance / std::max(Extent(key_point), kSmallestTrackRange);
  reach.level = reach.share >= kBeyondReach ? ReachLevel::kBeyond
                : reach.share >= kFarReach  ? ReachLevel::kFar
                                            : ReachLevel::kNear;
  return reach;
}

}  // namespace editnerf
