// A scene without its pixels as JSON text: cameras, ids, splits and units. What checkpoints carry.
#pragma once

#include <string>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

std::string SceneToJson(const Scene& scene);

// Throws DataError naming `where` and what is missing or of the wrong type.
Scene SceneFromJson(const std::string& text, const std::string& where);

}  // namespace editnerf
