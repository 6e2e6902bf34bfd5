// Camera JSON files of the Nerfies layout, and the change between world and scene units.
#pragma once

#include <filesystem>
#include <string>

#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/scene/scene.h"

namespace editnerf {

// A camera as the file has it: world units in a scene folder. Both spellings of the tangential distortion are accepted.
// Throws DataError naming the file and the field that is missing, not finite or out of range.
Camera ReadCameraFile(const std::filesystem::path& path);
void WriteCameraFile(const std::filesystem::path& path, const Camera& camera);

// The same on a JSON object inside another file; `where` starts the error messages.
Camera CameraFromJson(const Json& json, const std::string& where);
Json CameraToJson(const Camera& camera);

// scene = (world - center) * scale.
Camera CameraInSceneUnits(const Camera& world_camera, const SceneTransform& transform);
Camera CameraInWorldUnits(const Camera& scene_camera, const SceneTransform& transform);

}  // namespace editnerf
