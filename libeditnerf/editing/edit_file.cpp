#include "libeditnerf/editing/edit_file.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/json_text.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/json_file.h"

namespace editnerf {
namespace {

constexpr size_t kMaxKeyPoints = 64;
constexpr double kMaxSide = 65536;

void CheckKeys(const Json& object, std::initializer_list<const char*> known, const std::string& where) {
  if (!object.is_object()) Throw<DataError>("{}: expected an object, found {}", where, Brief(object));
  for (const auto& item : object.items()) {
    if (std::find(known.begin(), known.end(), item.key()) != known.end()) continue;
    std::string names;
    for (const char* name : known) names += (names.empty() ? "" : ", ") + std::string(name);
    Throw<DataError>("{}: unknown key '{}'; expected one of: {}", where, item.key(), names);
  }
}

std::string FrameId(const Json& value, const std::string& where) {
  if (!value.is_string() || value.get<std::string>().empty()) {
    Throw<DataError>("{}: expected the id of a frame in quotes, found {}", where, Brief(value));
  }
  return value.get<std::string>();
}

std::optional<Vec3> KeyPoint(const Json& value, const std::string& where) {
  if (value.is_null()) return std::nullopt;
  const bool three = value.is_array() && value.size() == 3;
  if (!three || !std::all_of(value.begin(), value.end(), [](const Json& number) {
        return number.is_number() && std::isfinite(number.get<double>());
      })) {
    Throw<DataError>("{}: expected 3 numbers in scene units, or null, found {}", where, Brief(value));
  }
  return Vec3{value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
}

std::vector<std::optional<Vec3>> KeyPoints(const Json& list, const std::string& where) {
  if (!list.is_array()) {
    Throw<DataError>("{}: expected a list with one position, or null, for each key point, found {}", where,
                     Brief(list));
  }
  if (list.size() > kMaxKeyPoints) {
    Throw<DataError>("{}: expected at most {} key points, found {}", where, kMaxKeyPoints, list.size());
  }
  std::vector<std::optional<Vec3>> key_points;
  for (size_t i = 0; i < list.size(); ++i) key_points.push_back(KeyPoint(list[i], fmt::format("{}[{}]", where, i)));
  return key_points;
}

EditFrame ParseFrame(const Json& json, const EditFrame* previous, const std::string& where) {
  CheckKeys(json, {"key_points", "camera", "code_frame"}, where);
  EditFrame frame;
  if (json.contains("key_points")) frame.key_points = KeyPoints(json["key_points"], where + ".key_points");
  if (json.contains("code_frame")) frame.code_frame = FrameId(json["code_frame"], where + ".code_frame");
  const bool moved =
      std::any_of(frame.key_points.begin(), frame.key_points.end(), [](const auto& k) { return k.has_value(); });
  if (frame.code_frame.empty() && !moved) {
    Throw<DataError>("{}: names neither a key point position nor a code_frame; give at least one", where);
  }
  if (json.contains("camera")) {
    const Json& camera = json["camera"];
    if (camera.is_object()) {
      frame.camera = CameraFromJson(camera, where + ".camera");
    } else {
      frame.camera_frame = FrameId(camera, where + ".camera");
    }
  } else if (previous != nullptr) {
    frame.camera = previous->camera;
    frame.camera_frame = previous->camera_frame;
  } else {
    Throw<DataError>("{}: 'camera' is missing; give a camera or the id of a scene frame in the first frame", where);
  }
  return frame;
}

Json CameraEntry(const EditFrame& frame) {
  return frame.camera ? CameraToJson(*frame.camera) : Json(frame.camera_frame);
}

Json FrameToJson(const EditFrame& frame, const EditFrame* previous) {
  Json json = Json::object();
  for (const auto& key_point : frame.key_points) {
    json["key_points"].push_back(key_point ? Json{key_point->x, key_point->y, key_point->z} : Json(nullptr));
  }
  if (!frame.code_frame.empty()) json["code_frame"] = frame.code_frame;
  const Json camera = CameraEntry(frame);
  if (previous == nullptr || CameraEntry(*previous) != camera) json["camera"] = camera;
  return json;
}

EditFile FromJson(const Json& json, const std::string& name) {
  CheckKeys(json, {"fps", "size", "frames"}, name);
  EditFile edit;
  if (json.contains("fps")) edit.fps = JsonNumber(json, "fps", name);
  if (!(edit.fps > 0 && edit.fps <= 1000)) {
    Throw<DataError>("{}: fps: expected a rate above 0 and up to 1000, found {}", name, edit.fps);
  }
  if (json.contains("size")) {
    const auto size = JsonNumbers(json, "size", 2, name);
    for (const double side : size) {
      if (!(side >= 1 && side <= kMaxSide) || side != std::floor(side)) {
        Throw<DataError>("{}: size: expected whole numbers from 1 to {}, found {} x {}", name, kMaxSide, size[0],
                         size[1]);
      }
    }
    edit.width = static_cast<int64_t>(size[0]);
    edit.height = static_cast<int64_t>(size[1]);
  }
  const Json& frames = JsonField(json, "frames", name);
  if (!frames.is_array() || frames.empty()) {
    Throw<DataError>("{}: frames: expected a list of at least one frame, found {}", name, Brief(frames));
  }
  for (size_t i = 0; i < frames.size(); ++i) {
    const EditFrame* const previous = i > 0 ? &edit.frames.back() : nullptr;
    auto frame = ParseFrame(frames[i], previous, fmt::format("{}: frames[{}]", name, i));
    edit.frames.push_back(std::move(frame));
  }
  return edit;
}

}  // namespace

EditFile ParseEditFile(const std::string& text, const std::string& name) {
  return FromJson(ParseJson(text, name), name);
}

EditFile ReadEditFile(const std::filesystem::path& path) {
  return ParseEditFile(ReadFile(path, kMaxJsonBytes), path.string());
}

std::string WriteEditFile(const EditFile& edit) {
  Json json = {{"fps", edit.fps}, {"frames", Json::array()}};
  if (edit.width > 0 || edit.height > 0) json["size"] = {edit.width, edit.height};
  for (size_t i = 0; i < edit.frames.size(); ++i) {
    json["frames"].push_back(FrameToJson(edit.frames[i], i > 0 ? &edit.frames[i - 1] : nullptr));
  }
  FromJson(json, "edit");
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace editnerf
