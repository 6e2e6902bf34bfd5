// The hand that holds the camera: a wandering arc around a focus point, monocular and without roll.
#pragma once

#include <cstdint>

#include "libeditnerf/geometry/camera.h"

namespace editnerf::synthetic {

struct CameraPathOptions {
  Vec3 focus = {0, 0, 0.4};    // world, z up; the camera looks from -y towards it
  double distance = 4.1;       // world units
  double half_arc = 0.61;      // radians to each side
  double elevation = 0.38;     // radians above the horizon, on average
  double focal_widths = 1.15;  // focal length over the image width
  int64_t width = 0, height = 0;
  uint64_t seed = 0;
};

// The training camera at time t in [0, 1], world units.
Camera TrainingCamera(const CameraPathOptions& options, double t);

// A camera that training never held: off the path that it takes at time t, by as much as between two passes.
Camera NovelCamera(const CameraPathOptions& options, double t, uint64_t number);

}  // namespace editnerf::synthetic
