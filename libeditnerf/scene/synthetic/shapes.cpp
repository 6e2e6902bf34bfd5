#include "libeditnerf/scene/synthetic/shapes.h"

#include <algorithm>

namespace editnerf::synthetic {
namespace {

double IntersectBox(const Vec3& half, const Ray& ray, double closest) {
  const double origin[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
  const double direction[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  const double size[3] = {half.x, half.y, half.z};
  double enter = -1e30, leave = 1e30;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (std::abs(origin[axis]) > size[axis]) return -1;
      continue;
    }
    const double a = (-size[axis] - origin[axis]) / direction[axis], b = (size[axis] - origin[axis]) / direction[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  if (enter > leave) return -1;
  if (enter > closest) return enter;
  return leave > closest ? leave : -1;
}

// Roots of a t^2 + 2 b t + c in ascending order; false if there are none.
bool Roots(double a, double b, double c, double roots[2]) {
  const double discriminant = b * b - a * c;
  if (discriminant < 0 || a == 0) return false;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));  // no cancellation
  roots[0] = q / a;
  roots[1] = q == 0 ? roots[0] : c / q;
  if (roots[0] > roots[1]) std::swap(roots[0], roots[1]);
  return true;
}

double IntersectSphere(double radius, const Ray& ray, double closest) {
  double roots[2];
  const double c = Dot(ray.origin, ray.origin) - radius * radius;
  if (!Roots(1, Dot(ray.origin, ray.direction), c, roots)) return -1;
  if (roots[0] > closest) return roots[0];
  return roots[1] > closest ? roots[1] : -1;
}

double IntersectFrustum(const Shape& shape, const Ray& ray, double closest) {
  const double slope = (shape.size.y - shape.size.x) / shape.size.z;
  const Vec3& o = ray.origin;
  const Vec3& d = ray.direction;
  const double r = shape.size.x + slope * o.z, dr = slope * d.z;  // the radius along the ray
  double roots[2];
  if (!Roots(d.x * d.x + d.y * d.y - dr * dr, o.x * d.x + o.y * d.y - r * dr, o.x * o.x + o.y * o.y - r * r, roots)) {
    return -1;
  }
  for (const double t : roots) {
    if (!(t > closest)) continue;
    const double z = o.z + t * d.z;
    if (z < 0 || z > shape.size.z) continue;
    if (shape.inside_only && Dot(NormalAt(shape, ray.At(t)), d) < 0) continue;
    return t;
  }
  return -1;
}

double IntersectDisk(const Shape& shape, const Ray& ray, double closest) {
  if (ray.direction.z == 0) return -1;
  const double t = -ray.origin.z / ray.direction.z;
  if (!(t > closest)) return -1;
  const Vec3 p = ray.At(t);
  const double r2 = p.x * p.x + p.y * p.y;
  return r2 >= shape.size.x * shape.size.x && r2 <= shape.size.y * shape.size.y ? t : -1;
}

// 0, 1, 2: the axis whose face of the box `point` lies on.
int FaceAxis(const Vec3& half, const Vec3& point) {
  const double x = half.x - std::abs(point.x), y = half.y - std::abs(point.y), z = half.z - std::abs(point.z);
  if (x < y && x < z) return 0;
  return y < z ? 1 : 2;
}

}  // namespace

double Shape::BoundingRadius() const {
  switch (kind) {
    case Kind::kBox:
      return Norm(size);
    case Kind::kSphere:
      return size.x;
    case Kind::kFrustum:
      return std::hypot(std::max(size.x, size.y), size.z / 2);
    case Kind::kDisk:
      return size.y;
  }
  return 0;
}

Vec3 Shape::BoundingCenter() const { return kind == Kind::kFrustum ? Vec3{0, 0, size.z / 2} : Vec3{}; }

double Intersect(const Shape& shape, const Ray& ray, double closest) {
  switch (shape.kind) {
    case Shape::Kind::kBox:
      return IntersectBox(shape.size, ray, closest);
    case Shape::Kind::kSphere:
      return IntersectSphere(shape.size.x, ray, closest);
    case Shape::Kind::kFrustum:
      return IntersectFrustum(shape, ray, closest);
    case Shape::Kind::kDisk:
      return IntersectDisk(shape, ray, closest);
  }
  return -1;
}

Vec3 NormalAt(const Shape& shape, const Vec3& point) {
  switch (shape.kind) {
    case Shape::Kind::kBox: {
      const int axis = FaceAxis(shape.size, point);
      if (axis == 0) return {std::copysign(1.0, point.x), 0, 0};
      if (axis == 1) return {0, std::copysign(1.0, point.y), 0};
      return {0, 0, std::copysign(1.0, point.z)};
    }
    case Shape::Kind::kSphere:
      return Normalized(point);
    case Shape::Kind::kFrustum: {
      const double slope = (shape.size.y - shape.size.x) / shape.size.z;
      return Normalized({point.x, point.y, -slope * std::sqrt(point.x * point.x + point.y * point.y)});
    }
    case Shape::Kind::kDisk:
      break;
  }
  return {0, 0, 1};
}

SurfacePlace PlaceAt(const Shape& shape, const Vec3& point) {
  switch (shape.kind) {
    case Shape::Kind::kBox: {
      const int axis = FaceAxis(shape.size, point);
      // Each face takes its own piece of the pattern.
      if (axis == 0) return {point, point.y + std::copysign(7.3, point.x), point.z};
      if (axis == 1) return {point, point.x + std::copysign(3.1, point.y), point.z};
      return {point, point.x, point.y + std::copysign(5.7, point.z)};
    }
    case Shape::Kind::kSphere:
      return {point, std::atan2(point.y, point.x) * shape.size.x,
              std::asin(std::clamp(point.z / shape.size.x, -1.0, 1.0)) * shape.size.x};
    case Shape::Kind::kFrustum:
      return {point, std::atan2(point.y, point.x) * (shape.size.x + shape.size.y) / 2, point.z};
    case Shape::Kind::kDisk:
      break;
  }
  return {point, point.x, point.y};
}

Shape Box(const Vec3& half_extents, const Material& material, const Vec3& center) {
  return {Shape::Kind::kBox, half_extents, material, {{}, center}, false};
}

Shape Sphere(double radius, const Material& material, const Vec3& center) {
  return {Shape::Kind::kSphere, {radius, 0, 0}, material, {{}, center}, false};
}

Shape Frustum(double bottom, double top, double height, const Material& material, const Vec3& base) {
  return {Shape::Kind::kFrustum, {bottom, top, height}, material, {{}, base}, false};
}

Shape Disk(double inner, double outer, const Material& material, const Vec3& center) {
  return {Shape::Kind::kDisk, {inner, outer, 0}, material, {{}, center}, false};
}

}  // namespace editnerf::synthetic
