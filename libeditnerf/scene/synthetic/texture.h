// Procedural textures in object coordinates. All are functions of position alone, so that a moving surface keeps its
// pattern, and none repeats exactly: flow and structure from motion need detail that occurs once.
#pragma once

#include <cstdint>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf::synthetic {

struct Texture {
  enum class Pattern { kPlain, kChecker, kStripes, kWood, kClouds, kDots, kMosaic };
  Pattern pattern = Pattern::kPlain;
  Vec3 first, second;   // linear RGB albedo in [0, 1]
  double scale = 0.1;   // size of one element, world units
  uint64_t seed = 0;    // where the pattern is cut from
  double colorful = 0;  // how far the elements of kDots and kMosaic stray from the two colours, 0..1
};

// A place on a surface: the point itself and an unrolled position on its face, both in world units.
struct SurfacePlace {
  Vec3 point;
  double u = 0, v = 0;
};

Vec3 Albedo(const Texture& texture, const SurfacePlace& place);

// Uniform in [0, 1), from integers alone.
double HashUnit(uint64_t a, uint64_t b = 0, uint64_t c = 0, uint64_t d = 0);

}  // namespace editnerf::synthetic
