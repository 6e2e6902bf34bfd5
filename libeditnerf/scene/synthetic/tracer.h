// Draws a stage of rigid bodies: Lambert and a mild highlight under one round area light with soft shadows,
// hemispherical ambient light, supersampling, and exact depth and masks through the pixel centres.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/scene/synthetic/shapes.h"

namespace editnerf::synthetic {

// Shapes that move together; object coordinates are in world units.
struct Body {
  std::string name;
  std::vector<Shape> shapes;
  bool moves = false;
};

struct Light {
  Vec3 position, target;  // world
  double radius = 0.5;    // of the disk that faces the target
  Vec3 color = {0.98, 0.93, 0.82};
  Vec3 sky = {0.25, 0.27, 0.32}, ground = {0.14, 0.125, 0.11};  // ambient light from above and from below
};

struct Hit {
  double distance = -1;  // along the unit direction; negative: nothing
  int body = -1;
  int shape = -1;  // among all shapes of the stage
};

// Bodies in their places at one moment.
class PlacedStage {
 public:
  // One pose per body, world_from_object. Keeps references to the bodies: they must outlive this.
  PlacedStage(const std::vector<Body>& bodies, const std::vector<Pose>& world_from_object, const Light& light);

  Hit Trace(const Ray& ray) const;  // world
  bool Occluded(const Vec3& from, const Vec3& to) const;

  // Which points of the light are asked: `count` of them, from number `first` of a low-discrepancy sequence that is
  // shifted by `shift` (in [0, 1)).
  struct ShadowRays {
    int64_t first = 0, count = 0;
    double shift[2] = {0, 0};
  };
  // Linear radiance towards the ray's origin. `lit` returns the fraction of the shadow rays that saw the light, 0 on a
  // surface that faces away; `hit` what the ray met.
  Vec3 Radiance(const Ray& ray, const ShadowRays& shadow_rays, double* lit, Hit* hit) const;

 private:
  struct Placed {
    const Shape* shape;
    Pose shape_from_world;
    Vec3 center;
    double radius;
  };
  struct Group {
    Vec3 center;
    double radius;
    int begin, end;
  };

  std::vector<Placed> placed_;
  std::vector<Group> groups_;  // one per body
  Light light_;
  Vec3 light_u_, light_v_;  // spans of the light's disk
};

// What one camera sees. rgb: 8 bit sRGB, row-major; depth: Euclidean distance in world units, infinite where nothing is
// hit; body: index of the body, -1 where nothing is hit.
struct View {
  std::vector<uint8_t> rgb;   // H * W * 3
  std::vector<double> depth;  // H * W
  std::vector<int> body;      // H * W
};

// Camera in world units. `noise_seed` decides where the shadow rays go. Runs in parallel over rows.
View RenderView(const PlacedStage& stage, const Camera& camera, int64_t samples_per_side, uint64_t noise_seed);

}  // namespace editnerf::synthetic
