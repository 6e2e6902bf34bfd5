// Cameras in general position for the geometry tests.
#pragma once

#include <cmath>
#include <vector>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

inline Mat3 RotationAbout(int axis, double angle) {
  Mat3 r;
  const int a = (axis + 1) % 3, b = (axis + 2) % 3;
  r(a, a) = r(b, b) = std::cos(angle);
  r(a, b) = -std::sin(angle);
  r(b, a) = std::sin(angle);
  return r;
}

// Three cameras of 64 x 48 pixels; the last one is without distortion.
inline std::vector<Camera> TestCameras(bool distorted) {
  std::vector<Camera> cameras;
  for (int i = 0; i < 3; ++i) {
    Camera camera;
    camera.orientation = RotationAbout(0, 0.3 + i) * RotationAbout(1, 1.1 * i - 0.4) * RotationAbout(2, 0.2 * i);
    camera.position = {0.3 * i, -0.2, 0.1 - 0.4 * i};
    camera.focal_length = 55 + 3 * i;
    camera.principal_point = {31.0 + i, 25.5 - i};
    camera.skew = 0.4 * i;
    camera.pixel_aspect_ratio = 1.0 + 0.05 * i;
    if (distorted && i < 2) {
      camera.radial_distortion = {0.08 - 0.15 * i, -0.02, 0.004};
      camera.tangential_distortion = {0.003, -0.002 + 0.001 * i};
    }
    camera.width = 64;
    camera.height = 48;
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace editnerf
