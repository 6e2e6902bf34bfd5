// The surfaces that the synthetic scenes are built from, with exact ray intersections.
#pragma once

#include "libeditnerf/scene/synthetic/pose.h"
#include "libeditnerf/scene/synthetic/texture.h"

namespace editnerf::synthetic {

struct Material {
  Texture texture;
  double specular = 0.08;  // strength of the highlight
  double shininess = 40;   // its exponent
};

struct Shape {
  enum class Kind {
    kBox,      // size: half extents
    kSphere,   // size.x: radius
    kFrustum,  // around z from 0 to size.z; radius size.x at the bottom, size.y at the top; no lids
    kDisk,     // in z = 0; radii from size.x to size.y
  };
  Kind kind = Kind::kBox;
  Vec3 size;
  Material material;
  Pose object_from_shape;
  bool inside_only = false;  // seen from inside alone, and casts no shadow (the backdrop)

  double BoundingRadius() const;  // around BoundingCenter()
  Vec3 BoundingCenter() const;    // shape coordinates
};

// direction: unit.
struct Ray {
  Vec3 origin, direction;
  Vec3 At(double distance) const { return origin + direction * distance; }
};

// Distance along `ray` (shape coordinates) to the nearest point of the surface beyond `closest` (> 0); negative: none.
double Intersect(const Shape& shape, const Ray& ray, double closest);

// At a point of the surface, in shape coordinates: the outward unit normal, and where the texture is looked up.
Vec3 NormalAt(const Shape& shape, const Vec3& point);
SurfacePlace PlaceAt(const Shape& shape, const Vec3& point);

// Shapes by their material; poses are set afterwards.
Shape Box(const Vec3& half_extents, const Material& material, const Vec3& center = {});
Shape Sphere(double radius, const Material& material, const Vec3& center = {});
Shape Frustum(double bottom, double top, double height, const Material& material, const Vec3& base = {});
Shape Disk(double inner, double outer, const Material& material, const Vec3& center = {});

}  // namespace editnerf::synthetic
