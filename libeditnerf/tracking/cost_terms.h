// Residuals that more than one least-squares problem of the trackers has, for Ceres' automatic derivatives. `weight` is
// the inverse of a standard deviation.
#pragma once

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

// | a - 2 b + c |: three places in a row, a frame apart.
struct SmoothnessTerm {
  double weight;

  template <class T>
  bool operator()(const T* before, const T* point, const T* after, T* residual) const {
    for (int i = 0; i < 3; ++i) residual[i] = T(weight) * (before[i] - T(2) * point[i] + after[i]);
    return true;
  }
};

// | p - target |
struct AnchorTerm {
  Vec3 target;
  double weight;

  template <class T>
  bool operator()(const T* point, T* residual) const {
    residual[0] = T(weight) * (point[0] - T(target.x));
    residual[1] = T(weight) * (point[1] - T(target.y));
    residual[2] = T(weight) * (point[2] - T(target.z));
    return true;
  }
};

// | a |^2 - 1, for directions.
struct UnitLengthTerm {
  double weight;

  template <class T>
  bool operator()(const T* axis, T* residual) const {
    residual[0] = T(weight) * (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2] - T(1));
    return true;
  }
};

}  // namespace editnerf
