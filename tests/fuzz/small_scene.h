// The smallest scene that passes all checks: two frames of 4 x 3 pixels.
#pragma once

#include "libeditnerf/scene/scene.h"

namespace editnerf::fuzz {

inline Camera SmallCamera() {
  Camera camera;
  camera.orientation = {{1, 0, 0, 0, 1, 0, 0, 0, 1}};
  camera.focal_length = 4;
  camera.principal_point = {2, 1.5};
  camera.width = 4;
  camera.height = 3;
  return camera;
}

inline Scene SmallScene() {
  Scene scene;
  scene.name = "small";
  scene.transform = {1, {0, 0, 0}, 0.5, 2};
  for (const char* id : {"a", "b"}) {
    scene.frames.emplace_back().id = id;
    scene.frames.back().camera = SmallCamera();
  }
  scene.images = torch::zeros({2, 3, 4, 3}, torch::kUInt8);
  scene.train = {0, 1};
  return scene;
}

}  // namespace editnerf::fuzz
