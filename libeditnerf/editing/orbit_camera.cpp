#include "libeditnerf/editing/orbit_camera.h"

#include <algorithm>
#include <cmath>

namespace editnerf {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kPoleMargin = 0.05;  // radians that the view keeps away from `up`

// Turns the camera with everything that it sees standing still, around `center`.
void Turn(const Vec3& axis, double angle, const Vec3& center, Camera* camera) {
  const Mat3 rotation = RotationAround(axis, angle);
  camera->position = center + rotation * (camera->position - center);
  camera->orientation = camera->orientation * rotation.Transposed();
}

// Rounding adds up over thousands of small turns: the rows are made orthonormal again.
void Straighten(Camera* camera) {
  const Vec3 z = Normalized(camera->orientation.Row(2));
  const Vec3 x = Normalized(camera->orientation.Row(0) - z * Dot(z, camera->orientation.Row(0)));
  const Vec3 y = Cross(z, x);
  camera->orientation = {{x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z}};
}

}  // namespace

Mat3 RotationAround(const Vec3& axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), d = 1 - c;
  const auto& [x, y, z] = axis;
  return {{c + d * x * x, d * x * y - s * z, d * x * z + s * y, d * x * y + s * z, c + d * y * y, d * y * z - s * x,
           d * x * z - s * y, d * y * z + s * x, c + d * z * z}};
}

Mat3 BetweenRotations(const Mat3& a, const Mat3& b, double share) {
  const Mat3 turn = b * a.Transposed();
  const double cosine = std::clamp((turn(0, 0) + turn(1, 1) + turn(2, 2) - 1) / 2, -1.0, 1.0),
               angle = std::acos(cosine);
  Vec3 axis = {turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)};
  if (Norm(axis) < 1e-9) {
    if (angle < 1) return share < 0.5 ? a : b;
    // Half a turn: the difference above vanishes, and the axis is the largest column of turn + 1.
    for (int i = 0; i < 3; ++i) {
      const Vec3 column = {turn(0, i) + (i == 0), turn(1, i) + (i == 1), turn(2, i) + (i == 2)};
      if (Norm(column) > Norm(axis)) axis = column;
    }
  }
  return RotationAround(Normalized(axis), share * angle) * a;
}

void OrbitCamera::Orbit(double right, double over) {
  Turn(up, right, target, &camera);
  const double now = std::acos(std::clamp(Dot(camera.orientation.Row(2), up), -1.0, 1.0));  // view to up
  const double wanted = std::clamp(now + over, kPoleMargin, kPi - kPoleMargin);
  // The camera's x axis points right: a positive turn around it lifts the view.
  Turn(camera.orientation.Row(0), now - wanted, target, &camera);
  Straighten(&camera);
}

void OrbitCamera::Pan(double du, double dv) {
  const double depth = std::max(Dot(camera.orientation.Row(2), target - camera.position), nearest);
  const double per_pixel = depth / camera.focal_length;
  const Vec3 move = -camera.orientation.Row(0) * (du * per_pixel) -
                    camera.orientation.Row(1) * (dv * per_pixel / camera.pixel_aspect_ratio);
  camera.position += move;
  target += move;
}

void OrbitCamera::Zoom(double factor) {
  const Vec3 offset = camera.position - target;
  const double distance = Norm(offset);
  if (!(distance > 0)) return;
  camera.position = target + offset * (std::clamp(distance * factor, nearest, farthest) / distance);
}

}  // namespace editnerf
