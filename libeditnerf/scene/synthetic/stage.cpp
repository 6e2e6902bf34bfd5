#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {
namespace {

constexpr double kBackdropRadius = 2.7;

Material Matte(const Texture& texture) { return {texture, 0.05, 30}; }

Pose Standing(const Vec3& place, double turn) { return {RotationZ(turn), place}; }

Body Still(std::vector<Shape> shapes, const Vec3& place, double turn) {
  for (Shape& shape : shapes) shape.object_from_shape = Standing(place, turn) * shape.object_from_shape;
  return {"", std::move(shapes), false};
}

}  // namespace

Body Studio(const Vec3& floor_color, const Vec3& wall_color) {
  const Texture floor = {Texture::Pattern::kMosaic, floor_color * 0.5, floor_color * 1.15, 0.12, 101, 0.3};
  const Texture wall = {Texture::Pattern::kMosaic, wall_color * 0.5, wall_color * 1.1, 0.26, 102, 0.25};
  Shape backdrop = Frustum(kBackdropRadius, kBackdropRadius, 12, {wall, 0, 1});
  backdrop.inside_only = true;
  return {"", {Disk(0, 8, {floor, 0, 1}), backdrop}, false};
}

Body Ball(const Vec3& place, double radius, const Texture& texture) {
  return Still({Sphere(radius, {texture, 0.2, 50}, {0, 0, radius})}, place, 0.7);
}

Body Cone(const Vec3& place, double radius, double height, const Texture& texture) {
  return Still({Frustum(radius, 0.01, height, Matte(texture))}, place, 0.2);
}

Body Vase(const Vec3& place, double radius, double height, const Texture& texture) {
  Texture inside = texture;
  inside.pattern = Texture::Pattern::kPlain;
  inside.first = texture.first * 0.5;
  return Still({Frustum(0.55 * radius, radius, 0.55 * height, {texture, 0.2, 40}),
                Frustum(radius, 0.5 * radius, 0.35 * height, {texture, 0.2, 40}, {0, 0, 0.55 * height}),
                Frustum(0.5 * radius, 0.65 * radius, 0.1 * height, {texture, 0.2, 40}, {0, 0, 0.9 * height}),
                Disk(0, 0.6 * radius, Matte(inside), {0, 0, 0.93 * height})},
               place, 0.4);
}

Body Block(const Vec3& place, const Vec3& half_extents, double turn, const Texture& texture) {
  return Still({Box(half_extents, Matte(texture), {0, 0, half_extents.z})}, place, turn);
}

}  // namespace editnerf::synthetic
