// An axis-aligned box.
#pragma once

#include <algorithm>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

struct Box {
  Vec3 low, high;

  Vec3 Size() const { return high - low; }
  Vec3 Center() const { return 0.5 * (low + high); }
  double LongestSide() const { return std::max({Size().x, Size().y, Size().z}); }
};

}  // namespace editnerf
