#include "libeditnerf/scene/scene_json.h"

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

using nlohmann::json;

Vec3 ToVec3(const json& value) {
  const auto v = value.get<std::array<double, 3>>();
  return {v[0], v[1], v[2]};
}

Camera CameraFromJson(const json& value) {
  Camera c;
  c.orientation.m = value.at("orientation").get<std::array<double, 9>>();
  c.position = ToVec3(value.at("position"));
  c.focal_length = value.at("focal_length");
  c.principal_point = value.at("principal_point").get<std::array<double, 2>>();
  c.skew = value.at("skew");
  c.pixel_aspect_ratio = value.at("pixel_aspect_ratio");
  c.radial_distortion = value.at("radial_distortion").get<std::array<double, 3>>();
  c.tangential_distortion = value.at("tangential_distortion").get<std::array<double, 2>>();
  const auto size = value.at("image_size").get<std::array<int64_t, 2>>();
  c.width = size[0];
  c.height = size[1];
  return c;
}

}  // namespace

json CameraFields(const Camera& c) {
  return {{"orientation", c.orientation.m},
          {"position", {c.position.x, c.position.y, c.position.z}},
          {"focal_length", c.focal_length},
          {"principal_point", c.principal_point},
          {"skew", c.skew},
          {"pixel_aspect_ratio", c.pixel_aspect_ratio},
          {"radial_distortion", c.radial_distortion},
          {"tangential_distortion", c.tangential_distortion},
          {"image_size", {c.width, c.height}}};
}

json ToJson(const SceneTransform& t) {
  return {{"scale", t.scale}, {"center", {t.center.x, t.center.y, t.center.z}}, {"near", t.near}, {"far", t.far}};
}

SceneTransform TransformFromJson(const json& value) {
  return {value.at("scale"), ToVec3(value.at("center")), value.at("near"), value.at("far")};
}

std::string SceneToJson(const Scene& scene) {
  json frames = json::array();
  for (const SceneFrame& frame : scene.frames) {
    frames.push_back({{"id", frame.id},
                      {"warp_id", frame.warp_id},
                      {"appearance_id", frame.appearance_id},
                      {"camera", CameraFields(frame.camera)}});
  }
  json value = ToJson(scene.transform);
  value["name"] = scene.name;
  value["frames"] = std::move(frames);
  value["train"] = scene.train;
  value["val"] = scene.val;
  value["edit"] = scene.edit;
  return value.dump();
}

Scene SceneFromJson(const std::string& text, const std::string& where) {
  try {
    const json value = json::parse(text);
    Scene scene;
    scene.name = value.at("name");
    scene.transform = TransformFromJson(value);
    for (const json& frame : value.at("frames")) {
      scene.frames.push_back(
          {frame.at("id"), frame.at("warp_id"), frame.at("appearance_id"), CameraFromJson(frame.at("camera"))});
      scene.frames.back().camera.Check((where + ": camera " + scene.frames.back().id).c_str());
    }
    const auto split = [&](const char* name) {
      auto indices = value.at(name).get<std::vector<int64_t>>();
      for (const int64_t index : indices) {
        if (index < 0 || index >= static_cast<int64_t>(scene.frames.size())) {
          Throw<DataError>("{}: '{}' names frame {} of {}", where, name, index, scene.frames.size());
        }
      }
      return indices;
    };
    scene.train = split("train");
    scene.val = split("val");
    scene.edit = split("edit");
    return scene;
  } catch (const json::exception& error) {
    Throw<DataError>("{}: not a scene description: {}", where, error.what());
  }
}

}  // namespace editnerf
