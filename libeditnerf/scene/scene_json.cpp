#include "libeditnerf/scene/scene_json.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/json_text.h"

namespace editnerf {
namespace {

using nlohmann::json;

Vec3 ToVec3(const json& value) {
  const auto v = value.get<std::array<double, 3>>();
  return {v[0], v[1], v[2]};
}

Camera ToCamera(const json& value, const std::string& where) {
  Camera c;
  c.orientation.m = value.at("orientation").get<std::array<double, 9>>();
  c.position = ToVec3(value.at("position"));
  c.focal_length = value.at("focal_length");
  c.principal_point = value.at("principal_point").get<std::array<double, 2>>();
  c.skew = value.at("skew");
  c.pixel_aspect_ratio = value.at("pixel_aspect_ratio");
  c.radial_distortion = value.at("radial_distortion").get<std::array<double, 3>>();
  c.tangential_distortion = value.at("tangential_distortion").get<std::array<double, 2>>();
  c.width = WholeNumber(value.at("image_size").at(0), where);
  c.height = WholeNumber(value.at("image_size").at(1), where);
  c.Check(where.c_str());
  return c;
}

// Four significant digits.
double Rounded(float value) {
  if (value == 0) return 0;
  const double unit = std::pow(10, 3 - std::floor(std::log10(std::abs(value))));
  return std::round(value * unit) / unit;
}

torch::Tensor PointsFromJson(const json& value, const std::string& where) {
  if (!value.is_array()) Throw<DataError>("{}: 'points': expected a list, found {}", where, value.type_name());
  std::vector<float> numbers;
  for (const json& point : value) {
    const bool good = point.is_array() && point.size() == 3 &&
                      std::all_of(point.begin(), point.end(),
                                  [](const json& x) { return x.is_number() && std::abs(x.get<double>()) <= FLT_MAX; });
    if (!good) {
      Throw<DataError>("{}: 'points': expected 3 finite numbers for each, found {}", where, point.dump().substr(0, 40));
    }
    for (const json& x : point) numbers.push_back(x.get<float>());
  }
  if (numbers.empty()) return {};
  return torch::tensor(numbers, torch::kFloat32).view({-1, 3});
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

json PointsToJson(const torch::Tensor& points) {
  json list = json::array();
  if (!points.defined()) return list;
  // Of no use to a picture, and JSON has no infinity.
  constexpr double kTooFar = 1e30;
  const torch::Tensor all = points.to(torch::kCPU, torch::kFloat32);
  const torch::Tensor kept = all.index({(all.abs() < kTooFar).all(1)}).contiguous();
  const int64_t count = std::min(kept.size(0), kMaxScenePoints);
  for (int64_t i = 0; i < count; ++i) {
    const float* p = kept.data_ptr<float>() + 3 * (i * kept.size(0) / count);
    list.push_back({Rounded(p[0]), Rounded(p[1]), Rounded(p[2])});
  }
  return list;
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
  json points = PointsToJson(scene.points);
  if (!points.empty()) value["points"] = std::move(points);
  return value.dump(-1, ' ', false, json::error_handler_t::replace);  // a folder's name may hold any bytes
}

Scene SceneFromJson(const std::string& text, const std::string& where) {
  try {
    const json value = ParseJson(text, where);
    Scene scene;
    scene.name = value.at("name");
    scene.transform = TransformFromJson(value);
    const SceneTransform& units = scene.transform;
    if (!(units.scale > 0 && units.near > 0 && units.near < units.far)) {
      Throw<DataError>("{}: expected scale > 0 and 0 < near < far, found scale {}, near {} and far {}", where,
                       units.scale, units.near, units.far);
    }
    for (const json& frame : value.at("frames")) {
      const std::string id = frame.at("id"), frame_where = where + ": frame " + id;
      scene.frames.push_back({id, WholeNumber(frame.at("warp_id"), frame_where),
                              WholeNumber(frame.at("appearance_id"), frame_where),
                              ToCamera(frame.at("camera"), where + ": camera " + id)});
    }
    const auto split = [&](const char* name) {
      std::vector<int64_t> indices;
      for (const json& entry : value.at(name)) {
        const int64_t index = indices.emplace_back(WholeNumber(entry, where + ": '" + name + "'"));
        if (index < 0 || index >= static_cast<int64_t>(scene.frames.size())) {
          Throw<DataError>("{}: '{}' names frame {} of {}", where, name, index, scene.frames.size());
        }
      }
      return indices;
    };
    scene.train = split("train");
    scene.val = split("val");
    scene.edit = split("edit");
    if (value.contains("points")) scene.points = PointsFromJson(value["points"], where);
    return scene;
  } catch (const json::exception& error) {
    Throw<DataError>("{}: not a scene description: {}", where, error.what());
  }
}

}  // namespace editnerf
