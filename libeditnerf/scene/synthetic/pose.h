// Rigid transforms of the synthetic scenes.
#pragma once

#include "libeditnerf/geometry/vec3.h"

namespace editnerf::synthetic {

// parent_from_child: parent = rotation * child + translation.
struct Pose {
  Mat3 rotation;
  Vec3 translation;

  Vec3 operator*(const Vec3& child) const { return rotation * child + translation; }
  friend Pose operator*(const Pose& a, const Pose& b) { return {a.rotation * b.rotation, a * b.translation}; }
  Pose Inverse() const {
    const Mat3 back = rotation.Transposed();
    return {back, -(back * translation)};
  }
};

// Right-handed rotations about the axes, radians.
inline Mat3 RotationX(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {{1, 0, 0, 0, c, -s, 0, s, c}};
}
inline Mat3 RotationY(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {{c, 0, s, 0, 1, 0, -s, 0, c}};
}
inline Mat3 RotationZ(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {{c, -s, 0, s, c, 0, 0, 0, 1}};
}

}  // namespace editnerf::synthetic
