// The pinhole camera with distortion of the Nerfies / HyperNeRF layout.
//
// OpenCV axes (x right, y down, z forward); pixel centres lie at +0.5. The frame in which `orientation` and `position`
// are given is the owner's choice: files hold world units, everything inside the library holds scene units.
#pragma once

#include <array>
#include <cstdint>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

struct Camera {
  Mat3 orientation;                                // camera_from_world rotation, orthonormal
  Vec3 position;                                   // of the camera centre
  double focal_length = 1;                         // pixels along x
  std::array<double, 2> principal_point = {0, 0};  // pixels
  double skew = 0;
  double pixel_aspect_ratio = 1;  // focal length along y over focal length along x
  std::array<double, 3> radial_distortion = {0, 0, 0};
  std::array<double, 2> tangential_distortion = {0, 0};
  int64_t width = 0, height = 0;  // pixels

  bool HasDistortion() const;

  // The camera of the image downsampled by `factor` (to width x height pixels, each side rounded by the caller).
  Camera Resized(int64_t new_width, int64_t new_height) const;

  // Throws DataError naming `where` and the offending field unless every number is finite, the focal length is
  // positive, the sides have 1 to 65536 pixels and the orientation is a rotation to 1e-3.
  void Check(const char* where) const;

  // Unit direction, in the owner's frame, of the ray through pixel position (u, v); distortion is inverted by Newton's
  // method, and where that does not converge the undistorted direction is returned.
  Vec3 DirectionThrough(double u, double v) const;
};

// Pixel position of a point. `depth` is along the optical axis; `valid` is false at or behind the camera plane
// (depth <= 1e-6), where u and v are set to 0.
struct Projected {
  double u = 0, v = 0, depth = 0;
  bool valid = false;
};
Projected Project(const Camera& camera, const Vec3& point);

// The same for any scalar type (double, ceres::Jet). Returns false at or behind the camera plane and leaves `pixel`
// alone.
template <class T>
bool ProjectPoint(const Camera& camera, const T point[3], T pixel[2]) {
  const T dx = point[0] - T(camera.position.x), dy = point[1] - T(camera.position.y),
          dz = point[2] - T(camera.position.z);
  const Mat3& r = camera.orientation;
  const T cx = T(r(0, 0)) * dx + T(r(0, 1)) * dy + T(r(0, 2)) * dz;
  const T cy = T(r(1, 0)) * dx + T(r(1, 1)) * dy + T(r(1, 2)) * dz;
  const T cz = T(r(2, 0)) * dx + T(r(2, 1)) * dy + T(r(2, 2)) * dz;
  if (!(cz > T(1e-6))) return false;
  const T x = cx / cz, y = cy / cz;
  const T r2 = x * x + y * y;
  const auto& k = camera.radial_distortion;
  const auto& t = camera.tangential_distortion;
  const T radial = T(1) + r2 * (T(k[0]) + r2 * (T(k[1]) + r2 * T(k[2])));
  const T xd = x * radial + T(2 * t[0]) * x * y + T(t[1]) * (r2 + T(2) * x * x);
  const T yd = y * radial + T(2 * t[1]) * x * y + T(t[0]) * (r2 + T(2) * y * y);
  pixel[0] = T(camera.focal_length) * xd + T(camera.skew) * yd + T(camera.principal_point[0]);
  pixel[1] = T(camera.focal_length * camera.pixel_aspect_ratio) * yd + T(camera.principal_point[1]);
  return true;
}

}  // namespace editnerf
