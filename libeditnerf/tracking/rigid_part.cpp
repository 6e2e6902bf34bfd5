#include "libeditnerf/tracking/rigid_part.h"

#include <ceres/rotation.h>

#include <algorithm>

namespace editnerf {

Vec3 RigidPart::Place(int64_t t, const Vec3& position) const {
  const RigidPose& p = pose[static_cast<size_t>(t)];
  const double from[3] = {position.x - center.x, position.y - center.y, position.z - center.z};
  double turned[3];
  ceres::AngleAxisRotatePoint(p.rotation.data(), from, turned);
  return {turned[0] + center.x + p.translation[0], turned[1] + center.y + p.translation[1],
          turned[2] + center.z + p.translation[2]};
}

Vec3 RigidPart::TakeBack(int64_t t, const Vec3& point) const {
  const RigidPose& p = pose[static_cast<size_t>(t)];
  const double back[3] = {-p.rotation[0], -p.rotation[1], -p.rotation[2]};
  const double from[3] = {point.x - center.x - p.translation[0], point.y - center.y - p.translation[1],
                          point.z - center.z - p.translation[2]};
  double turned[3];
  ceres::AngleAxisRotatePoint(back, from, turned);
  return {turned[0] + center.x, turned[1] + center.y, turned[2] + center.z};
}

std::vector<int64_t> SeenFrames(const RigidPart& part) {
  std::vector<int64_t> frames;
  for (size_t t = 0; t < part.seen.size(); ++t)
    if (part.seen[t]) frames.push_back(static_cast<int64_t>(t));
  return frames;
}

double PointRange(const RigidPart& part, const Vec3& position, const std::vector<int64_t>& frames) {
  if (frames.empty()) return 0;
  std::vector<double> x, y, z, distance;
  for (const int64_t t : frames) {
    const Vec3 at = part.Place(t, position);
    x.push_back(at.x), y.push_back(at.y), z.push_back(at.z);
  }
  const auto quantile = [](std::vector<double> values, double share) {
    const auto at = values.begin() + static_cast<int64_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
  };
  const Vec3 median = {quantile(x, 0.5), quantile(y, 0.5), quantile(z, 0.5)};
  for (size_t i = 0; i < x.size(); ++i) distance.push_back(Norm(Vec3{x[i], y[i], z[i]} - median));
  return quantile(distance, 0.95);
}

}  // namespace editnerf
