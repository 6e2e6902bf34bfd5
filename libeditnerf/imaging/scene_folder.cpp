#include "libeditnerf/imaging/scene_folder.h"

#include <algorithm>
#include <map>
#include <set>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/imaging/scene_images.h"
#include "libeditnerf/imaging/truth_files.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

constexpr size_t kAutoHoldOutFrames = 16;  // 'auto' holds frames out from this many training frames on

// dataset.json and gt/edits.json after the checks.
struct Splits {
  std::vector<std::string> ids, train, val, edit;
};

SceneTransform ReadTransform(const fs::path& path) {
  const Json json = ReadJson(path);
  const std::string where = path.string();
  SceneTransform transform;
  transform.scale = JsonNumber(json, "scale", where);
  const auto center = JsonNumbers(json, "center", 3, where);
  transform.center = {center[0], center[1], center[2]};
  transform.near = JsonNumber(json, "near", where);
  transform.far = JsonNumber(json, "far", where);
  if (!(transform.scale > 0))
    Throw<DataError>("{}: scale: expected a positive number, found {}", where, transform.scale);
  if (!(transform.near > 0 && transform.near < transform.far)) {
    Throw<DataError>("{}: expected 0 < near < far, found near {} and far {}", where, transform.near, transform.far);
  }
  return transform;
}

std::set<std::string> Distinct(const std::vector<std::string>& ids, const char* list, const std::string& where) {
  std::set<std::string> distinct;
  for (const std::string& id : ids) {
    if (id.empty() || id == "." || id == ".." || id.find('/') != std::string::npos) {
      Throw<DataError>("{}: {}: '{}' cannot be the name of a frame", where, list, id);
    }
    if (!distinct.insert(id).second) Throw<DataError>("{}: {}: '{}' is listed twice", where, list, id);
  }
  return distinct;
}

void CheckKnown(const std::vector<std::string>& ids, const std::set<std::string>& all, const char* list,
                const std::string& where) {
  for (const std::string& id : ids) {
    if (all.count(id) == 0) Throw<DataError>("{}: {}: '{}' is not in 'ids' of dataset.json", where, list, id);
  }
}

Splits ReadSplits(const fs::path& folder) {
  const fs::path path = folder / "dataset.json";
  const Json json = ReadJson(path);
  const std::string where = path.string();
  Splits splits;
  splits.ids = JsonStrings(json, "ids", where);
  splits.train = JsonStrings(json, "train_ids", where);
  splits.val = JsonStrings(json, "val_ids", where);
  splits.edit = ReadEditIds(folder);
  const std::string edits_where = (folder / "gt" / "edits.json").string();
  const auto all = Distinct(splits.ids, "ids", where);
  const auto train = Distinct(splits.train, "train_ids", where);
  const auto val = Distinct(splits.val, "val_ids", where);
  Distinct(splits.edit, "ids", edits_where);
  CheckKnown(splits.train, all, "train_ids", where);
  CheckKnown(splits.val, all, "val_ids", where);
  CheckKnown(splits.edit, all, "ids", edits_where);
  if (json.contains("count") && JsonInteger(json, "count", where) != static_cast<int64_t>(all.size())) {
    Throw<DataError>("{}: 'count' is {}, but 'ids' lists {} frames", where, JsonInteger(json, "count", where),
                     all.size());
  }
  for (const std::string& id : splits.val) {
    if (train.count(id) > 0) Throw<DataError>("{}: '{}' is in both 'train_ids' and 'val_ids'", where, id);
  }
  for (const std::string& id : splits.edit) {
    if (train.count(id) + val.count(id) > 0) {
      Throw<DataError>("{}: '{}' is an edit frame, but dataset.json has it in 'train_ids' or 'val_ids'", edits_where,
                       id);
    }
  }
  if (train.size() < 2) {
    Throw<DataError>("{}: expected at least two training frames, found {}; one view alone does not determine a scene",
                     where, train.size());
  }
  return splits;
}

// Where the folder names no validation frames, some of the training frames become some. Every second one, the paper's
// protocol, doubles the motion between the frames that are left: key points of fast parts are lost by it.
void HoldOut(const std::string& hold_out, Splits* splits) {
  if (!splits->val.empty() || hold_out == "none") return;
  if (hold_out == "auto" && splits->train.size() < kAutoHoldOutFrames) return;
  std::vector<std::string> kept;
  const size_t period = hold_out == "odd" ? 2 : 8;
  for (size_t i = 0; i < splits->train.size(); ++i)
    (i % period == period / 2 ? splits->val : kept).push_back(splits->train[i]);
  if (kept.size() < 2) {
    Throw<ConfigError>("data.hold_out: '{}' leaves {} of {} training frames; set it to none", hold_out, kept.size(),
                       splits->train.size());
  }
  splits->train = kept;
}

// metadata.json of one frame: the number of its object state and of its appearance.
void ReadCodes(const Json& metadata, const std::string& where, SceneFrame* frame) {
  const auto entry = metadata.find(frame->id);
  if (entry == metadata.end()) {
    Throw<DataError>("{}: no entry for frame '{}'; every training and validation frame needs one", where, frame->id);
  }
  const std::string entry_where = where + ": " + frame->id;
  const auto number = [&](const char* key) {
    const int64_t value = JsonInteger(*entry, key, entry_where);
    if (value < 0 || value > 1000000) {
      Throw<DataError>("{}: {}: expected 0 to 1000000, found {}", entry_where, key, value);
    }
    return value;
  };
  const bool by_time = entry->is_object() && !entry->contains("warp_id") && entry->contains("time_id");
  frame->warp_id = number(by_time ? "time_id" : "warp_id");
  frame->appearance_id = number("appearance_id");
}

torch::Tensor ReadPoints(const fs::path& path, const SceneTransform& transform) {
  const torch::Tensor world = ReadNpy(path);
  if (world.dim() != 2 || world.size(1) != 3 || !world.is_floating_point()) {
    Throw<DataError>("{}: expected [P, 3] floating point numbers", path.string());
  }
  if (!world.isfinite().all().item<bool>()) Throw<DataError>("{}: holds points that are not finite", path.string());
  const Vec3& c = transform.center;
  const torch::Tensor center = torch::tensor({c.x, c.y, c.z}, torch::kFloat64);
  return ((world.to(torch::kFloat64) - center) * transform.scale).to(torch::kFloat32);
}

// World-unit cameras of the frames; all must announce one image size.
void ReadCameras(const fs::path& folder, std::vector<SceneFrame>* frames) {
  for (SceneFrame& frame : *frames) {
    const fs::path path = folder / "camera" / (frame.id + ".json");
    frame.camera = ReadCameraFile(path);
    const Camera& first = frames->front().camera;
    if (frame.camera.width != first.width || frame.camera.height != first.height) {
      Throw<DataError>("{}: image_size: {} x {}, expected {} x {} as in camera/{}.json; all frames must have one size",
                       path.string(), frame.camera.width, frame.camera.height, first.width, first.height,
                       frames->front().id);
    }
  }
}

std::string NameOf(const fs::path& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

}  // namespace

Scene ReadSceneFolder(const fs::path& folder, const DataConfig& config) {
  if (!fs::is_directory(folder)) {
    Throw<DataError>(
        "{}: no such folder; expected a scene folder (scene.json, dataset.json, metadata.json, camera/, rgb/)",
        folder.string());
  }
  Scene scene;
  scene.name = NameOf(folder);
  scene.transform = ReadTransform(folder / "scene.json");
  Splits splits = ReadSplits(folder);
  HoldOut(config.hold_out, &splits);

  std::set<std::string> used;
  for (const auto* split : {&splits.train, &splits.val, &splits.edit}) used.insert(split->begin(), split->end());
  const std::set<std::string> edit(splits.edit.begin(), splits.edit.end());
  const fs::path metadata_path = folder / "metadata.json";
  const Json metadata = ReadJson(metadata_path);
  std::map<std::string, int64_t> index;
  std::vector<std::string> ids;
  for (const std::string& id : splits.ids) {
    if (used.count(id) == 0) continue;
    index[id] = static_cast<int64_t>(ids.size());
    ids.push_back(id);
    SceneFrame frame;
    frame.id = id;
    if (edit.count(id) == 0) ReadCodes(metadata, metadata_path.string(), &frame);
    scene.frames.push_back(frame);
  }
  if (ids.size() < splits.ids.size()) {
    LogDebug("{}: {} frames belong to no split and are left out", scene.name, splits.ids.size() - ids.size());
  }
  for (const std::string& id : splits.train) scene.train.push_back(index.at(id));
  for (const std::string& id : splits.val) scene.val.push_back(index.at(id));
  for (const std::string& id : splits.edit) scene.edit.push_back(index.at(id));

  ReadCameras(folder, &scene.frames);
  const int64_t full_width = scene.frames[0].camera.width, full_height = scene.frames[0].camera.height;
  scene.images = ReadSceneImages(folder, ids, full_width, full_height, ImageFactor(config, full_width, full_height));
  for (SceneFrame& frame : scene.frames) {
    frame.camera = CameraInSceneUnits(frame.camera, scene.transform).Resized(scene.width(), scene.height());
  }
  const fs::path points_path = folder / "points.npy";
  if (fs::exists(points_path)) scene.points = ReadPoints(points_path, scene.transform);
  if (HasTruth(folder)) scene.truth = ReadTruth(folder, ids, scene.transform, scene.height(), scene.width());
  scene.Check();
  return scene;
}

}  // namespace editnerf
