#include "libeditnerf/scene/packed_scene.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/json_text.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/scene/scene_json.h"

namespace editnerf {
namespace {

using Json = nlohmann::json;

constexpr const char* kFormat = "editnerf-scene";
constexpr const char* kVersion = "1";
constexpr int64_t kIntrinsics = 5;
constexpr int64_t kDistortion = 5;

torch::Tensor Pack(const std::vector<int64_t>& values) {
  return torch::tensor(values, torch::kInt64).reshape({static_cast<int64_t>(values.size())});
}

std::vector<int64_t> Unpack(const torch::Tensor& values) {
  return {values.data_ptr<int64_t>(), values.data_ptr<int64_t>() + values.numel()};
}

// The tensors of a file, asked for one by one with their type and shape.
class TensorReader {
 public:
  TensorReader(std::string path, std::map<std::string, torch::Tensor> tensors)
      : path_(std::move(path)), tensors_(std::move(tensors)) {}

  bool Has(const std::string& name) const { return tensors_.count(name) > 0; }

  torch::Tensor Get(const std::string& name, torch::ScalarType type, std::initializer_list<int64_t> shape) const {
    const auto entry = tensors_.find(name);
    if (entry == tensors_.end()) Throw<DataError>("{}: tensor '{}' is missing", path_, name);
    if (entry->second.scalar_type() != type) {
      Throw<DataError>("{}: tensor '{}': expected {}, found {}", path_, name, c10::toString(type),
                       c10::toString(entry->second.scalar_type()));
    }
    try {
      CheckShape(entry->second, shape, name.c_str());
    } catch (const ShapeError& error) {
      Throw<DataError>("{}: {}", path_, error.what());
    }
    return entry->second;
  }

 private:
  std::string path_;
  std::map<std::string, torch::Tensor> tensors_;
};

void PackCameras(const Scene& scene, std::map<std::string, torch::Tensor>& tensors) {
  const auto count = static_cast<int64_t>(scene.frames.size());
  torch::Tensor orientation = torch::empty({count, 3, 3}, torch::kFloat64);
  torch::Tensor position = torch::empty({count, 3}, torch::kFloat64);
  torch::Tensor intrinsics = torch::empty({count, kIntrinsics}, torch::kFloat64);
  torch::Tensor distortion = torch::empty({count, kDistortion}, torch::kFloat64);
  for (int64_t i = 0; i < count; ++i) {
    const Camera& camera = scene.frames[static_cast<size_t>(i)].camera;
    std::copy(camera.orientation.m.begin(), camera.orientation.m.end(), orientation.data_ptr<double>() + 9 * i);
    double* const p = position.data_ptr<double>() + 3 * i;
    p[0] = camera.position.x, p[1] = camera.position.y, p[2] = camera.position.z;
    double* const k = intrinsics.data_ptr<double>() + kIntrinsics * i;
    k[0] = camera.focal_length, k[1] = camera.principal_point[0], k[2] = camera.principal_point[1];
    k[3] = camera.skew, k[4] = camera.pixel_aspect_ratio;
    double* const d = distortion.data_ptr<double>() + kDistortion * i;
    std::copy(camera.radial_distortion.begin(), camera.radial_distortion.end(), d);
    std::copy(camera.tangential_distortion.begin(), camera.tangential_distortion.end(), d + 3);
  }
  tensors["camera.orientation"] = orientation;
  tensors["camera.position"] = position;
  tensors["camera.intrinsics"] = intrinsics;
  tensors["camera.distortion"] = distortion;
}

void UnpackCameras(const TensorReader& reader, Scene& scene) {
  const auto count = static_cast<int64_t>(scene.frames.size());
  const torch::Tensor orientation = reader.Get("camera.orientation", torch::kFloat64, {count, 3, 3});
  const torch::Tensor position = reader.Get("camera.position", torch::kFloat64, {count, 3});
  const torch::Tensor intrinsics = reader.Get("camera.intrinsics", torch::kFloat64, {count, kIntrinsics});
  const torch::Tensor distortion = reader.Get("camera.distortion", torch::kFloat64, {count, kDistortion});
  for (int64_t i = 0; i < count; ++i) {
    Camera& camera = scene.frames[static_cast<size_t>(i)].camera;
    const double* const r = orientation.data_ptr<double>() + 9 * i;
    std::copy(r, r + 9, camera.orientation.m.begin());
    const double* const p = position.data_ptr<double>() + 3 * i;
    camera.position = {p[0], p[1], p[2]};
    const double* const k = intrinsics.data_ptr<double>() + kIntrinsics * i;
    camera.focal_length = k[0];
    camera.principal_point = {k[1], k[2]};
    camera.skew = k[3];
    camera.pixel_aspect_ratio = k[4];
    const double* const d = distortion.data_ptr<double>() + kDistortion * i;
    camera.radial_distortion = {d[0], d[1], d[2]};
    camera.tangential_distortion = {d[3], d[4]};
    camera.width = scene.width();
    camera.height = scene.height();
  }
}

Json SceneJson(const Scene& scene) {
  Json ids = Json::array(), objects = Json::array();
  for (const SceneFrame& frame : scene.frames) ids.push_back(frame.id);
  if (scene.truth) objects = scene.truth->objects;
  Json json = ToJson(scene.transform);
  json["name"] = scene.name;
  json["ids"] = std::move(ids);
  json["objects"] = std::move(objects);
  return json;
}

// What the JSON says; returns the names of the moving objects.
std::vector<std::string> ReadSceneJson(const std::string& path, const std::string& text, Scene& scene) {
  try {
    const Json json = ParseJson(text, path + ": metadata 'scene'");
    scene.name = json.at("name").get<std::string>();
    scene.transform = TransformFromJson(json);
    for (const auto& id : json.at("ids")) scene.frames.emplace_back().id = id.get<std::string>();
    return json.at("objects").get<std::vector<std::string>>();
  } catch (const Json::exception& error) {
    Throw<DataError>("{}: metadata 'scene' is damaged: {}", path, error.what());
  }
}

SafetensorsFile ReadFileOf(const std::filesystem::path& path) {
  try {
    return ReadSafetensors(path);
  } catch (const CheckpointError& error) {
    throw DataError(error.what());
  }
}

}  // namespace

void SavePackedScene(const Scene& scene, const std::filesystem::path& path) {
  scene.Check();
  const auto count = static_cast<int64_t>(scene.frames.size());
  std::map<std::string, torch::Tensor> tensors;
  PackCameras(scene, tensors);
  std::vector<int64_t> warp_ids, appearance_ids;
  for (const SceneFrame& frame : scene.frames) {
    warp_ids.push_back(frame.warp_id);
    appearance_ids.push_back(frame.appearance_id);
  }
  tensors["images"] = scene.images;
  tensors["frame.warp_id"] = Pack(warp_ids);
  tensors["frame.appearance_id"] = Pack(appearance_ids);
  tensors["split.train"] = Pack(scene.train);
  tensors["split.val"] = Pack(scene.val);
  tensors["split.edit"] = Pack(scene.edit);
  if (scene.points.defined()) tensors["points"] = scene.points;
  if (scene.truth) {
    const auto objects = static_cast<int64_t>(scene.truth->objects.size());
    CheckShape(scene.truth->scene_from_object, {count, objects, 4, 4}, "scene_from_object");
    CheckShape(scene.truth->depth, {count, scene.height(), scene.width()}, "true depth");
    CheckShape(scene.truth->mask, {count, scene.height(), scene.width()}, "true mask");
    tensors["truth.scene_from_object"] = scene.truth->scene_from_object;
    tensors["truth.depth"] = scene.truth->depth;
    tensors["truth.mask"] = scene.truth->mask;
  }
  WriteSafetensors(path, tensors, {{"format", kFormat}, {"version", kVersion}, {"scene", SceneJson(scene).dump()}});
}

Scene LoadPackedScene(const std::filesystem::path& path) {
  SafetensorsFile file = ReadFileOf(path);
  const std::string where = path.string();
  if (file.metadata["format"] != kFormat) {
    Throw<DataError>("{}: expected a packed scene (format '{}'), found format '{}'", where, kFormat,
                     file.metadata["format"]);
  }
  if (file.metadata["version"] != kVersion) {
    Throw<DataError>("{}: expected version {} of the packed scene, found '{}'", where, kVersion,
                     file.metadata["version"]);
  }
  Scene scene;
  std::vector<std::string> objects = ReadSceneJson(where, file.metadata["scene"], scene);
  const auto count = static_cast<int64_t>(scene.frames.size());
  const TensorReader reader(where, std::move(file.tensors));
  scene.images = reader.Get("images", torch::kUInt8, {count, kAny, kAny, 3});
  UnpackCameras(reader, scene);
  const torch::Tensor warp_id = reader.Get("frame.warp_id", torch::kInt64, {count});
  const torch::Tensor appearance_id = reader.Get("frame.appearance_id", torch::kInt64, {count});
  for (int64_t i = 0; i < count; ++i) {
    scene.frames[static_cast<size_t>(i)].warp_id = warp_id.data_ptr<int64_t>()[i];
    scene.frames[static_cast<size_t>(i)].appearance_id = appearance_id.data_ptr<int64_t>()[i];
  }
  scene.train = Unpack(reader.Get("split.train", torch::kInt64, {kAny}));
  scene.val = Unpack(reader.Get("split.val", torch::kInt64, {kAny}));
  scene.edit = Unpack(reader.Get("split.edit", torch::kInt64, {kAny}));
  if (reader.Has("points")) scene.points = reader.Get("points", torch::kFloat32, {kAny, 3});
  if (reader.Has("truth.scene_from_object")) {
    GroundTruth truth;
    const auto object_count = static_cast<int64_t>(objects.size());
    truth.objects = std::move(objects);
    truth.scene_from_object = reader.Get("truth.scene_from_object", torch::kFloat64, {count, object_count, 4, 4});
    truth.depth = reader.Get("truth.depth", torch::kFloat32, {count, scene.height(), scene.width()});
    truth.mask = reader.Get("truth.mask", torch::kUInt8, {count, scene.height(), scene.width()});
    scene.truth = std::move(truth);
  }
  try {
    scene.Check();
  } catch (const DataError& error) {
    Throw<DataError>("{}: {}", where, error.what());
  }
  return scene;
}

}  // namespace editnerf
