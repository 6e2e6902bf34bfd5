// The median of points, axis by axis.
#pragma once

#include <utility>
#include <vector>

#include "libeditnerf/base/percentile.h"
#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

// The origin without any.
inline Vec3 MedianPoint(const std::vector<Vec3>& points) {
  std::vector<double> x, y, z;
  for (const Vec3& p : points) x.push_back(p.x), y.push_back(p.y), z.push_back(p.z);
  return {Percentile(std::move(x), 0.5), Percentile(std::move(y), 0.5), Percentile(std::move(z), 0.5)};
}

}  // namespace editnerf
