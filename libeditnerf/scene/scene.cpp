#include "libeditnerf/scene/scene.h"

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

int64_t Scene::FrameIndex(const std::string& id) const {
  for (size_t i = 0; i < frames.size(); ++i)
    if (frames[i].id == id) return static_cast<int64_t>(i);
  Throw<DataError>("{}: no frame with id '{}'", name, id);
}

void Scene::Check() const {
  const auto count = static_cast<int64_t>(frames.size());
  if (train.size() < 2) {
    Throw<DataError>("{}: expected at least two training frames, found {}; one view alone does not determine a scene",
                     name, train.size());
  }
  if (!(transform.scale > 0) || !std::isfinite(transform.scale)) {
    Throw<DataError>("{}: scene.json: scale: expected a positive number, found {}", name, transform.scale);
  }
  if (!(transform.near > 0 && transform.near < transform.far) || !std::isfinite(transform.far)) {
    Throw<DataError>("{}: scene.json: expected 0 < near < far, found near {} and far {}", name, transform.near,
                     transform.far);
  }
  CheckShape(images, {count, kAny, kAny, 3}, "scene images");
  for (const auto* split : {&train, &val, &edit}) {
    for (const int64_t index : *split) {
      if (index < 0 || index >= count) Throw<DataError>("{}: a split names frame {} of {}", name, index, count);
    }
  }
  for (const SceneFrame& frame : frames) {
    frame.camera.Check((name + ": camera " + frame.id).c_str());
    if (frame.camera.width != width() || frame.camera.height != height()) {
      Throw<DataError>("{}: camera {}: its images have {} x {} pixels, the others {} x {}", name, frame.id,
                       frame.camera.width, frame.camera.height, width(), height());
    }
  }
}

}  // namespace editnerf
