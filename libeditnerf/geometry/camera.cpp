#include "libeditnerf/geometry/camera.h"

#include <cmath>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr int kUndistortIterations = 20;
constexpr double kUndistortTolerance = 1e-12;
constexpr int64_t kMaxImageSide = 65536;  // pixels; four times that of any camera

struct Plane {
  double x, y;
};

// Distorted image plane coordinates and their Jacobian [dxd/dx, dxd/dy, dyd/dx, dyd/dy].
Plane Distort(const Camera& camera, Plane p, double jacobian[4]) {
  const auto& k = camera.radial_distortion;
  const auto& t = camera.tangential_distortion;
  const double r2 = p.x * p.x + p.y * p.y;
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
  const double slope = k[0] + r2 * (2 * k[1] + r2 * 3 * k[2]);  // d radial / d r2
  jacobian[0] = radial + 2 * p.x * p.x * slope + 2 * t[0] * p.y + 6 * t[1] * p.x;
  jacobian[1] = 2 * p.x * p.y * slope + 2 * t[0] * p.x + 2 * t[1] * p.y;
  jacobian[2] = 2 * p.x * p.y * slope + 2 * t[1] * p.y + 2 * t[0] * p.x;
  jacobian[3] = radial + 2 * p.y * p.y * slope + 2 * t[1] * p.x + 6 * t[0] * p.y;
  return {p.x * radial + 2 * t[0] * p.x * p.y + t[1] * (r2 + 2 * p.x * p.x),
          p.y * radial + 2 * t[1] * p.x * p.y + t[0] * (r2 + 2 * p.y * p.y)};
}

Plane Undistort(const Camera& camera, Plane target) {
  Plane p = target;
  for (int i = 0; i < kUndistortIterations; ++i) {
    double j[4];
    const Plane found = Distort(camera, p, j);
    const double ex = found.x - target.x, ey = found.y - target.y;
    if (std::abs(ex) + std::abs(ey) < kUndistortTolerance) return p;
    const double det = j[0] * j[3] - j[1] * j[2];
    if (!(std::abs(det) > 1e-9)) return target;  // at a fold of the distortion: no inverse
    p.x -= (j[3] * ex - j[1] * ey) / det;
    p.y -= (j[0] * ey - j[2] * ex) / det;
  }
  double j[4];
  const Plane found = Distort(camera, p, j);
  const double error = std::abs(found.x - target.x) + std::abs(found.y - target.y);
  return error < 1e-6 ? p : target;
}

}  // namespace

bool Camera::HasDistortion() const {
  for (const double k : radial_distortion)
    if (k != 0) return true;
  for (const double t : tangential_distortion)
    if (t != 0) return true;
  return false;
}

Camera Camera::Resized(int64_t new_width, int64_t new_height) const {
  const double sx = static_cast<double>(new_width) / static_cast<double>(width);
  const double sy = static_cast<double>(new_height) / static_cast<double>(height);
  Camera resized = *this;
  resized.width = new_width;
  resized.height = new_height;
  resized.focal_length *= sx;
  resized.pixel_aspect_ratio *= sy / sx;
  resized.skew *= sx;
  resized.principal_point = {principal_point[0] * sx, principal_point[1] * sy};
  return resized;
}

void Camera::Check(const char* where) const {
  const auto finite = [where](double value, const char* field) {
    if (!std::isfinite(value)) Throw<DataError>("{}: {}: expected a finite number, found {}", where, field, value);
  };
  for (const double value : orientation.m) finite(value, "orientation");
  for (const double value : {position.x, position.y, position.z}) finite(value, "position");
  finite(focal_length, "focal_length");
  finite(skew, "skew");
  finite(pixel_aspect_ratio, "pixel_aspect_ratio");
  for (const double value : principal_point) finite(value, "principal_point");
  for (const double value : radial_distortion) finite(value, "radial_distortion");
  for (const double value : tangential_distortion) finite(value, "tangential_distortion");
  if (!(focal_length > 0))
    Throw<DataError>("{}: focal_length: expected a positive number, found {}", where, focal_length);
  if (!(pixel_aspect_ratio > 0)) {
    Throw<DataError>("{}: pixel_aspect_ratio: expected a positive number, found {}", where, pixel_aspect_ratio);
  }
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide) {
    Throw<DataError>("{}: image_size: expected 1 to {} pixels, found {} x {}", where, kMaxImageSide, width, height);
  }
  const Mat3 product = orientation * orientation.Transposed();
  double deviation = 0;
  for (int i = 0; i < 9; ++i) deviation = std::max(deviation, std::abs(product.m[i] - (i % 4 == 0 ? 1.0 : 0.0)));
  const double determinant = Dot(orientation.Row(0), Cross(orientation.Row(1), orientation.Row(2)));
  if (deviation > 1e-3 || determinant < 0) {
    Throw<DataError>("{}: orientation: expected a rotation matrix; it is off by {:.2g} and its determinant is {:.3g}",
                     where, deviation, determinant);
  }
}

Vec3 Camera::DirectionThrough(double u, double v) const {
  const double y = (v - principal_point[1]) / (focal_length * pixel_aspect_ratio);
  const double x = (u - principal_point[0] - skew * y) / focal_length;
  Plane p = {x, y};
  if (HasDistortion()) p = Undistort(*this, p);
  return Normalized(orientation.Transposed() * Vec3{p.x, p.y, 1});
}

Projected Project(const Camera& camera, const Vec3& point) {
  const double coordinates[3] = {point.x, point.y, point.z};
  double pixel[2];
  Projected projected;
  projected.depth = Dot(camera.orientation.Row(2), point - camera.position);
  if (!ProjectPoint(camera, coordinates, pixel)) return projected;
  projected.u = pixel[0];
  projected.v = pixel[1];
  projected.valid = true;
  return projected;
}

}  // namespace editnerf
