// A scene without its pixels as JSON text: cameras, ids, splits, units and some of its points. What checkpoints carry.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

constexpr int64_t kMaxScenePoints = 2000;  // enough to see a scene's shape from afar

std::string SceneToJson(const Scene& scene);

// Throws DataError naming `where` and what is missing or of the wrong type.
Scene SceneFromJson(const std::string& text, const std::string& where);

// The parts that other files share. {"scale", "center": [3], "near", "far"}; reading throws nlohmann's exceptions.
nlohmann::json ToJson(const SceneTransform& transform);
SceneTransform TransformFromJson(const nlohmann::json& value);

// At most kMaxScenePoints of the points, evenly picked, each 3 numbers of four digits; empty where they are undefined.
nlohmann::json PointsToJson(const torch::Tensor& points);

// The fields of a camera file, except that the orientation is nine numbers, row-major.
nlohmann::json CameraFields(const Camera& camera);

}  // namespace editnerf
