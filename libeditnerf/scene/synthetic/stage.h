// What every synthetic scene shares, and what one scene adds.
#pragma once

#include <functional>
#include <vector>

#include "libeditnerf/scene/synthetic/camera_path.h"
#include "libeditnerf/scene/synthetic/motion.h"
#include "libeditnerf/scene/synthetic/tracer.h"

namespace editnerf::synthetic {

struct Play {
  std::vector<Body> bodies;
  std::vector<Track> tracks;  // empty: nothing moves
  // world_from_object of every body that moves, in the order of `bodies`.
  std::function<std::vector<Pose>(const State&)> poses;
  CameraPathOptions camera;
  Light light = {{-2.3, -2.1, 4.3}, {0, 0, 0.3}};
};

// One file each.
Play HingePlay();
Play KeysPlay();
Play CupsPlay();
Play CabinetPlay();
Play StaticPlay();
Play MedleyPlay(uint64_t seed);  // another one for every seed

// The floor and the curved backdrop behind it, so that every pixel sees something; strongly and never equally textured.
Body Studio(const Vec3& floor_color, const Vec3& wall_color);

// Still life for the background, standing on the floor at `place`.
Body Ball(const Vec3& place, double radius, const Texture& texture);
Body Cone(const Vec3& place, double radius, double height, const Texture& texture);
Body Vase(const Vec3& place, double radius, double height, const Texture& texture);
Body Block(const Vec3& place, const Vec3& half_extents, double turn, const Texture& texture);

}  // namespace editnerf::synthetic
