#include "libeditnerf/imaging/camera_file.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/scene/scene_json.h"

namespace editnerf {

Camera CameraFromJson(const Json& json, const std::string& where) {
  Camera camera;
  const auto orientation = JsonMatrix(JsonField(json, "orientation", where), 3, 3, where + ": orientation");
  std::copy(orientation.begin(), orientation.end(), camera.orientation.m.begin());
  const auto position = JsonNumbers(json, "position", 3, where);
  camera.position = {position[0], position[1], position[2]};
  camera.focal_length = JsonNumber(json, "focal_length", where);
  const auto principal_point = JsonNumbers(json, "principal_point", 2, where);
  camera.principal_point = {principal_point[0], principal_point[1]};
  camera.skew = JsonNumber(json, "skew", where);
  camera.pixel_aspect_ratio = JsonNumber(json, "pixel_aspect_ratio", where);
  const auto radial = JsonNumbers(json, "radial_distortion", 3, where);
  camera.radial_distortion = {radial[0], radial[1], radial[2]};
  const bool old_spelling = json.contains("tangential") && !json.contains("tangential_distortion");
  const auto tangential = JsonNumbers(json, old_spelling ? "tangential" : "tangential_distortion", 2, where);
  camera.tangential_distortion = {tangential[0], tangential[1]};
  const auto size = JsonNumbers(json, "image_size", 2, where);
  for (const double side : size) {
    if (!(side >= 1 && side <= 65536) || side != std::floor(side)) {
      Throw<DataError>("{}: image_size: expected whole numbers from 1 to 65536, found {} x {}", where, size[0],
                       size[1]);
    }
  }
  camera.width = static_cast<int64_t>(size[0]);
  camera.height = static_cast<int64_t>(size[1]);
  camera.Check(where.c_str());
  return camera;
}

Json CameraToJson(const Camera& camera) {
  const auto& m = camera.orientation.m;
  Json json = CameraFields(camera);
  json["orientation"] = {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}};
  return json;
}

Camera ReadCameraFile(const std::filesystem::path& path) { return CameraFromJson(ReadJson(path), path.string()); }

void WriteCameraFile(const std::filesystem::path& path, const Camera& camera) { WriteJson(path, CameraToJson(camera)); }

Camera CameraInSceneUnits(const Camera& world_camera, const SceneTransform& transform) {
  Camera camera = world_camera;
  camera.position = (world_camera.position - transform.center) * transform.scale;
  return camera;
}

Camera CameraInWorldUnits(const Camera& scene_camera, const SceneTransform& transform) {
  Camera camera = scene_camera;
  camera.position = scene_camera.position / transform.scale + transform.center;
  return camera;
}

}  // namespace editnerf
