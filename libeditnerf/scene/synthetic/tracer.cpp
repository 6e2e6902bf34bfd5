#include "libeditnerf/scene/synthetic/tracer.h"

#include <algorithm>
#include <limits>

#include "libeditnerf/base/parallel.h"

namespace editnerf::synthetic {
namespace {

constexpr double kSurfaceOffset = 1e-6;  // world units; keeps rays from meeting the surface that they leave
constexpr double kFlatContrast = 0.02;   // range of the (roughly) encoded brightness in a pixel without detail
constexpr int64_t kFirstLookRays = 2;    // shadow rays per sample before it is known whether the light is partly hidden
constexpr int64_t kPenumbraRays = 4;     // shadow rays per sample where it is
constexpr double kTwoPi = 6.283185307179586;

bool MeetsSphere(const Ray& ray, const Vec3& center, double radius) {
  const Vec3 to_center = center - ray.origin;
  const double along = Dot(to_center, ray.direction);
  const double distance2 = Dot(to_center, to_center);
  if (along < 0 && distance2 > radius * radius) return false;
  return distance2 - along * along <= radius * radius;
}

Ray Transformed(const Pose& pose, const Ray& ray) { return {pose * ray.origin, pose.rotation * ray.direction}; }

double Fraction(double x) { return x - std::floor(x); }

double Encode(double linear) {  // sRGB
  const double x = std::clamp(linear, 0.0, 1.0);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

Vec3 Clamped(const Vec3& c) { return {std::min(c.x, 1.0), std::min(c.y, 1.0), std::min(c.z, 1.0)}; }

}  // namespace

PlacedStage::PlacedStage(const std::vector<Body>& bodies, const std::vector<Pose>& world_from_object,
                         const Light& light)
    : light_(light) {
  for (size_t b = 0; b < bodies.size(); ++b) {
    Group group = {{}, 0, static_cast<int>(placed_.size()), 0};
    for (const Shape& shape : bodies[b].shapes) {
      const Pose pose = world_from_object[b] * shape.object_from_shape;
      placed_.push_back({&shape, pose.Inverse(), pose * shape.BoundingCenter(), shape.BoundingRadius() * (1 + 1e-9)});
    }
    group.end = static_cast<int>(placed_.size());
    for (int i = group.begin; i < group.end; ++i) group.center += placed_[i].center / (group.end - group.begin);
    for (int i = group.begin; i < group.end; ++i) {
      group.radius = std::max(group.radius, Norm(placed_[i].center - group.center) + placed_[i].radius);
    }
    groups_.push_back(group);
  }
  const Vec3 axis = Normalized(light.target - light.position);
  light_u_ = Normalized(Cross(axis, std::abs(axis.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0})) * light.radius;
  light_v_ = Cross(axis, light_u_);
}

Hit PlacedStage::Trace(const Ray& ray) const {
  Hit nearest;
  nearest.distance = std::numeric_limits<double>::infinity();
  for (size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (!MeetsSphere(ray, group.center, group.radius)) continue;
    for (int i = group.begin; i < group.end; ++i) {
      const Placed& placed = placed_[i];
      if (!MeetsSphere(ray, placed.center, placed.radius)) continue;
      const double distance = Intersect(*placed.shape, Transformed(placed.shape_from_world, ray), kSurfaceOffset);
      if (distance > 0 && distance < nearest.distance) nearest = {distance, static_cast<int>(g), i};
    }
  }
  return nearest.body < 0 ? Hit{} : nearest;
}

bool PlacedStage::Occluded(const Vec3& from, const Vec3& to) const {
  const double length = Norm(to - from);
  const Ray ray = {from, (to - from) / length};
  for (const Group& group : groups_) {
    if (!MeetsSphere(ray, group.center, group.radius)) continue;
    for (int i = group.begin; i < group.end; ++i) {
      const Placed& placed = placed_[i];
      if (placed.shape->inside_only || !MeetsSphere(ray, placed.center, placed.radius)) continue;
      const double distance = Intersect(*placed.shape, Transformed(placed.shape_from_world, ray), kSurfaceOffset);
      if (distance > 0 && distance < length) return true;
    }
  }
  return false;
}

Vec3 PlacedStage::Radiance(const Ray& ray, const ShadowRays& shadow_rays, double* lit, Hit* hit) const {
  *lit = 0;
  *hit = Trace(ray);
  if (hit->body < 0) return {};
  const Placed& placed = placed_[hit->shape];
  const Shape& shape = *placed.shape;
  const Vec3 point = ray.At(hit->distance);
  const Vec3 local = placed.shape_from_world * point;
  Vec3 normal = placed.shape_from_world.rotation.Transposed() * NormalAt(shape, local);
  if (Dot(normal, ray.direction) > 0) normal = -normal;  // open surfaces have two sides
  const Vec3 albedo = Albedo(shape.material.texture, PlaceAt(shape, local));

  const double up = 0.5 + 0.5 * normal.z;
  Vec3 light = light_.ground + (light_.sky - light_.ground) * up;
  Vec3 highlight;
  const Vec3 from = point + normal * (4 * kSurfaceOffset);
  const Vec3 to_lamp = Normalized(light_.position - point);
  const double facing = Dot(normal, to_lamp);
  if (facing > 0) {
    for (int64_t k = 0; k < shadow_rays.count; ++k) {
      // The additive recurrence of the plastic number fills the square evenly for every count.
      const double number = static_cast<double>(shadow_rays.first + k);
      const double radius = std::sqrt(Fraction(shadow_rays.shift[0] + number * 0.7548776662466927));
      const double angle = kTwoPi * Fraction(shadow_rays.shift[1] + number * 0.5698402909980532);
      const Vec3 lamp = light_.position + light_u_ * (radius * std::cos(angle)) + light_v_ * (radius * std::sin(angle));
      if (!Occluded(from, lamp)) *lit += 1.0 / static_cast<double>(shadow_rays.count);
    }
    light += light_.color * (facing * *lit);
    const double gloss = Dot(normal, Normalized(to_lamp - ray.direction));
    if (gloss > 0)
      highlight = light_.color * (shape.material.specular * std::pow(gloss, shape.material.shininess) * *lit);
  }
  return albedo * light + highlight;
}

View RenderView(const PlacedStage& stage, const Camera& camera, int64_t samples_per_side, uint64_t noise_seed) {
  const int64_t width = camera.width, height = camera.height, side = samples_per_side;
  View view;
  view.rgb.resize(static_cast<size_t>(width * height * 3));
  view.depth.resize(static_cast<size_t>(width * height));
  view.body.resize(static_cast<size_t>(width * height));

  const auto render_pixel = [&](int64_t x, int64_t y) {
    const auto index = static_cast<size_t>(y * width + x);
    const double px = static_cast<double>(x), py = static_cast<double>(y);
    const Hit center = stage.Trace({camera.position, camera.DirectionThrough(px + 0.5, py + 0.5)});
    view.depth[index] = center.body < 0 ? std::numeric_limits<double>::infinity() : center.distance;
    view.body[index] = center.body;

    PlacedStage::ShadowRays shadow_rays;
    shadow_rays.shift[0] = HashUnit(noise_seed, index, 1);
    shadow_rays.shift[1] = HashUnit(noise_seed, index, 2);
    const auto sample = [&](double dx, double dy, int64_t rays, double* lit, Hit* hit) {
      shadow_rays.first += shadow_rays.count;
      shadow_rays.count = rays;
      return Clamped(
          stage.Radiance({camera.position, camera.DirectionThrough(px + dx, py + dy)}, shadow_rays, lit, hit));
    };

    // Sample k lies in row k % side; the first `side` samples take every row and every column once. They are the first
    // look, after which a flat pixel is done.
    Vec3 sum;
    int64_t rays = kFirstLookRays, count = 0;
    double low = 1e9, high = -1e9;
    bool penumbra = false, edge = false;
    while (count < side * side) {
      const int64_t row = count % side;
      const int64_t column = (2 * row + (side % 2 == 0 && 2 * row >= side ? 1 : 0) + count / side) % side;
      double lit;
      Hit hit;
      const Vec3 color = sample((static_cast<double>(column) + 0.5) / static_cast<double>(side),
                                (static_cast<double>(row) + 0.5) / static_cast<double>(side), rays, &lit, &hit);
      sum += color;
      if (++count > side) continue;
      const double tone = std::sqrt((color.x + color.y + color.z) / 3);
      low = std::min(low, tone), high = std::max(high, tone);
      penumbra |= lit > 0.01 && lit < 0.99;
      edge |= hit.shape != center.shape;
      if (count < side) continue;
      if (!penumbra && !edge && high - low < kFlatContrast) break;
      rays = penumbra ? kPenumbraRays : 1;
    }
    const Vec3 mean = sum / static_cast<double>(count);
    const double channels[3] = {mean.x, mean.y, mean.z};
    for (size_t c = 0; c < 3; ++c) {
      view.rgb[3 * index + c] = static_cast<uint8_t>(std::lround(255 * Encode(channels[c])));
    }
  };
  ParallelFor(height, 1, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y)
      for (int64_t x = 0; x < width; ++x) render_pixel(x, y);
  });
  return view;
}

}  // namespace editnerf::synthetic
