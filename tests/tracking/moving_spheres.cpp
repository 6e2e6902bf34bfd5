#include "moving_spheres.h"

#include <cmath>
#include <string>

namespace editnerf {
namespace {

double Hash(int64_t x, int64_t y, int64_t z, int64_t seed) {
  auto h = static_cast<uint64_t>(x * 73856093) ^ static_cast<uint64_t>(y * 19349663) ^
           static_cast<uint64_t>(z * 83492791) ^ static_cast<uint64_t>(seed * 2654435761);
  h ^= h >> 33, h *= 0xff51afd7ed558ccdULL, h ^= h >> 33, h *= 0xc4ceb9fe1a85ec53ULL, h ^= h >> 33;
  return static_cast<double>(h >> 11) * 0x1p-53;
}

double Noise(Vec3 p, int64_t seed) {
  const auto x = static_cast<int64_t>(std::floor(p.x)), y = static_cast<int64_t>(std::floor(p.y)),
             z = static_cast<int64_t>(std::floor(p.z));
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double fx = smooth(p.x - std::floor(p.x)), fy = smooth(p.y - std::floor(p.y)),
               fz = smooth(p.z - std::floor(p.z));
  double sum = 0;
  for (int64_t i = 0; i < 8; ++i) {
    const int64_t dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
    sum += (dx ? fx : 1 - fx) * (dy ? fy : 1 - fy) * (dz ? fz : 1 - fz) * Hash(x + dx, y + dy, z + dz, seed);
  }
  return sum;
}

double Texture(const Vec3& p, int64_t seed) { return 0.5 * Noise(p * 9, seed) + 0.5 * Noise(p * 22, seed + 100); }

Camera CameraAt(double angle, const ClipOptions& options) {
  const Vec3 target = {0, 0, 0.1};
  Camera camera;
  camera.position = target + Vec3{1.9 * std::sin(angle), -1.9 * std::cos(angle), 1.5};
  const Vec3 forward = Normalized(target - camera.position);
  const Vec3 right = Normalized(Cross(forward, {0, 0, 1}));
  const Vec3 down = Cross(forward, right);
  camera.orientation = {{right.x, right.y, right.z, down.x, down.y, down.z, forward.x, forward.y, forward.z}};
  camera.width = options.width;
  camera.height = options.height;
  camera.focal_length = 1.2 * static_cast<double>(options.width);
  camera.principal_point = {static_cast<double>(options.width) / 2, static_cast<double>(options.height) / 2};
  return camera;
}

struct Hit {
  double distance = NAN;
  int64_t part = -1;
  Vec3 local;  // in the part's own frame
};

Hit Trace(const std::vector<Sphere>& spheres, int64_t t, const Vec3& origin, const Vec3& direction) {
  Hit hit;
  if (direction.z < -1e-6) {
    hit.distance = -origin.z / direction.z;
    hit.local = origin + direction * hit.distance;
  }
  for (size_t i = 0; i < spheres.size(); ++i) {
    const Vec3 center = spheres[i].center(t);
    const Vec3 to = origin - center;
    const double b = Dot(to, direction), c = Dot(to, to) - spheres[i].radius * spheres[i].radius;
    if (b * b <= c) continue;
    const double distance = -b - std::sqrt(b * b - c);
    if (distance <= 0 || distance >= hit.distance) continue;
    hit = {distance, static_cast<int64_t>(i), origin + direction * distance - center};
    if (spheres[i].turn) hit.local = spheres[i].turn(t).Transposed() * hit.local;
  }
  return hit;
}

}  // namespace

Clip ClipWithoutFlow(const MovingSpheres& rendered) {
  Clip clip;
  clip.width = rendered.scene.width(), clip.height = rendered.scene.height();
  for (size_t t = 0; t < rendered.scene.frames.size(); ++t) {
    const auto row = static_cast<int64_t>(t);
    clip.cameras.push_back(rendered.scene.frames[t].camera);
    clip.images.push_back(rendered.scene.images[row]);
    clip.gray.push_back(rendered.scene.images[row].to(torch::kFloat32).mean(2).contiguous());
    clip.depth.push_back(rendered.maps.depth[row]);
  }
  return clip;
}

Sphere Sliding(const Vec3& center, const Vec3& amplitude, double cycles, int64_t frames, double radius) {
  return {radius, [=](int64_t t) {
            return center +
                   amplitude * std::sin(2 * M_PI * cycles * static_cast<double>(t) / static_cast<double>(frames));
          }};
}

Sphere Resting(const Vec3& center, double radius) {
  return {radius, [center](int64_t) { return center; }};
}

int64_t MovingSpheres::PartAt(int64_t frame, const Vec3& point) const {
  const Projected p = Project(scene.frames[static_cast<size_t>(frame)].camera, point);
  if (!p.valid || p.u < 0 || p.v < 0 || p.u >= static_cast<double>(scene.width()) ||
      p.v >= static_cast<double>(scene.height())) {
    return -2;
  }
  return part[frame][static_cast<int64_t>(p.v)][static_cast<int64_t>(p.u)].item<int64_t>();
}

MovingSpheres RenderMovingSpheres(const std::vector<Sphere>& spheres, const ClipOptions& options) {
  MovingSpheres clip;
  const int64_t frames = options.frames, height = options.height, width = options.width;
  clip.scene.name = "moving spheres";
  clip.scene.images = torch::zeros({frames, height, width, 3}, torch::kUInt8);
  clip.part = torch::full({frames, height, width}, -1, torch::kInt64);
  clip.maps.depth = torch::zeros({frames, height, width}, torch::kFloat32);
  torch::manual_seed(7);
  clip.maps.ambient = options.ambient_noise * torch::randn({frames, height, width, 3});
  const torch::Tensor depth_noise = 1 + options.depth_noise * torch::randn({frames, height, width});
  for (int64_t t = 0; t < frames; ++t) {
    SceneFrame frame;
    frame.id = std::to_string(t);
    frame.warp_id = frame.appearance_id = t;
    frame.camera = CameraAt(options.arc * (static_cast<double>(t) / static_cast<double>(frames) - 0.5), options);
    const Camera& camera = frame.camera;
    for (int64_t row = 0; row < height; ++row) {
      for (int64_t column = 0; column < width; ++column) {
        const int64_t pixel = (t * height + row) * width + column;
        const Vec3 direction =
            camera.DirectionThrough(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
        const Hit hit = Trace(spheres, t, camera.position, direction);
        clip.maps.depth.data_ptr<float>()[pixel] = static_cast<float>(hit.distance);
        clip.part.data_ptr<int64_t>()[pixel] = hit.part;
        const Vec3 place = camera.position + direction * hit.distance;
        const bool shaded = options.lamp && hit.part < 0 && Trace(spheres, t, place, *options.lamp).part >= 0;
        for (int64_t channel = 0; channel < 3; ++channel) {
          const double shade = (shaded ? 0.5 : 1) * (30 + 200 * Texture(hit.local, 10 * (hit.part + 2) + channel / 2));
          clip.scene.images.data_ptr<uint8_t>()[3 * pixel + channel] = static_cast<uint8_t>(shade);
        }
        if (hit.part < 0) continue;
        const Vec3 moved =
            spheres[static_cast<size_t>(hit.part)].center(t) - spheres[static_cast<size_t>(hit.part)].center(0);
        float* ambient = clip.maps.ambient.data_ptr<float>() + 3 * pixel;
        ambient[0] += static_cast<float>(moved.x), ambient[1] += static_cast<float>(moved.y);
        ambient[2] += static_cast<float>(moved.z);
      }
    }
    clip.scene.frames.push_back(frame);
    clip.scene.train.push_back(t);
  }
  clip.maps.depth = clip.maps.depth * depth_noise;
  clip.scene.Check();
  return clip;
}

}  // namespace editnerf
