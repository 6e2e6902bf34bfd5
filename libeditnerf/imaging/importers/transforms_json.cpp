#include "libeditnerf/imaging/importers/transforms_json.h"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

// A number of the frame, or else of the whole file, or else the fallback.
class Intrinsics {
 public:
  Intrinsics(const Json& file, const Json& frame, std::string where)
      : file_(file), frame_(frame), where_(std::move(where)) {}

  bool Has(const char* key) const { return frame_.contains(key) || file_.contains(key); }
  double Get(const char* key, double fallback) const {
    if (frame_.contains(key)) return JsonNumber(frame_, key, where_);
    if (file_.contains(key)) return JsonNumber(file_, key, where_);
    return fallback;
  }

 private:
  const Json& file_;
  const Json& frame_;
  std::string where_;
};

fs::path ImagePath(const fs::path& folder, const std::string& file_path) {
  const fs::path path = (folder / file_path).lexically_normal();
  return HasImageExtension(path) ? path : fs::path(path.string() + ".png");
}

}  // namespace

ImportedModel ReadTransformsJson(const fs::path& path) {
  const Json json = ReadJson(path);
  const Json& frames = JsonField(json, "frames", path.string());
  if (!frames.is_array() || frames.empty()) Throw<DataError>("{}: frames: expected a list of frames", path.string());
  ImportedModel model;
  bool all_timed = true;
  double image_width = 0, image_height = 0;  // of the first image, read at most once
  for (size_t i = 0; i < frames.size(); ++i) {
    const Json& entry = frames[i];
    const std::string where = path.string() + ": frame " + std::to_string(i);
    const Json& file_path = JsonField(entry, "file_path", where);
    if (!file_path.is_string()) Throw<DataError>("{}: file_path: expected a path in quotes", where);
    ImportedFrame frame;
    frame.name = file_path.get<std::string>();
    frame.image_path = ImagePath(path.parent_path(), frame.name);
    const auto m = JsonMatrix(JsonField(entry, "transform_matrix", where), 4, 4, where + ": transform_matrix");

    const Intrinsics values(json, entry, where);
    if (image_width == 0 && !(values.Has("w") && values.Has("h"))) {
      std::error_code none;
      if (!fs::exists(frame.image_path, none)) {
        Throw<DataError>("{}: file_path: {}: no such file", where, frame.image_path.string());
      }
      const torch::Tensor image = ReadImage(frame.image_path);
      image_width = static_cast<double>(image.size(1));
      image_height = static_cast<double>(image.size(0));
    }
    Camera& camera = frame.camera;
    const double width = values.Get("w", image_width), height = values.Get("h", image_height);
    if (!(width >= 1 && width <= 65536 && height >= 1 && height <= 65536)) {
      Throw<DataError>("{}: expected an image size of 1 to 65536 pixels, found {} x {}", where, width, height);
    }
    camera.width = static_cast<int64_t>(width);
    camera.height = static_cast<int64_t>(height);
    const double angle = values.Get("camera_angle_x", 0);
    if (!values.Has("fl_x") && !(angle > 0 && angle < 3.14)) {
      Throw<DataError>("{}: expected 'fl_x' [pixels] or 'camera_angle_x' [radians]", where);
    }
    camera.focal_length = values.Has("fl_x") ? values.Get("fl_x", 0) : 0.5 * width / std::tan(0.5 * angle);
    camera.pixel_aspect_ratio = values.Get("fl_y", camera.focal_length) / camera.focal_length;
    camera.principal_point = {values.Get("cx", 0.5 * width), values.Get("cy", 0.5 * height)};
    camera.radial_distortion = {values.Get("k1", 0), values.Get("k2", 0), values.Get("k3", 0)};
    camera.tangential_distortion = {values.Get("p1", 0), values.Get("p2", 0)};
    // The columns of the matrix are the camera's axes in the world; OpenCV's y and z point the other way.
    const Mat3 camera_from_world = {{m[0], m[4], m[8], -m[1], -m[5], -m[9], -m[2], -m[6], -m[10]}};
    camera.orientation = NearestRotation(camera_from_world, where + ": transform_matrix");
    camera.position = {m[3], m[7], m[11]};
    camera.Check(where.c_str());
    if (entry.contains("time")) {
      frame.time = JsonNumber(entry, "time", where);
    } else {
      all_timed = false;
    }
    model.frames.push_back(std::move(frame));
  }
  if (all_timed) {
    std::stable_sort(model.frames.begin(), model.frames.end(),
                     [](const ImportedFrame& a, const ImportedFrame& b) { return a.time < b.time; });
  }
  return model;
}

}  // namespace editnerf
