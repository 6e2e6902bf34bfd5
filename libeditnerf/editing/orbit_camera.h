// Moving a camera by hand: around a point, sideways, and closer.
//
// Everything is in scene units; the camera keeps its lens and image size.
#pragma once

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

struct OrbitCamera {
  Camera camera;
  Vec3 target;            // what the camera turns around; it need not be in the middle of the image
  Vec3 up = {0, -1, 0};   // of the scene, unit length
  double nearest = 0.01;  // distances from the target that Zoom keeps to, scene units
  double farthest = 100.0;

  // Radians: to the right around `up`, and over the top. Stops short of looking along `up`.
  void Orbit(double right, double over);

  // Sideways, the target with it: what lies at the target's depth moves by (du, dv) pixels in the image.
  void Pan(double du, double dv);

  // Multiplies the distance from the target; factor > 0.
  void Zoom(double factor);
};

// The rotation by `angle` radians around the unit vector `axis`.
Mat3 RotationAround(const Vec3& axis, double angle);

// The rotation on the shortest way from `a` to `b`, by `share` of the way: 0 gives a, 1 gives b.
Mat3 BetweenRotations(const Mat3& a, const Mat3& b, double share);

}  // namespace editnerf
