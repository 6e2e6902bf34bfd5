#include "libeditnerf/imaging/importers/colmap_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/importers/colmap_files.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

bool HasAll(const fs::path& folder, const std::string& ending) {
  return fs::exists(folder / ("cameras" + ending)) && fs::exists(folder / ("images" + ending)) &&
         fs::exists(folder / ("points3D" + ending));
}

colmap::Files ReadFiles(const fs::path& folder) {
  if (HasAll(folder, ".bin")) return colmap::ReadBinary(folder);
  if (HasAll(folder, ".txt")) return colmap::ReadText(folder);
  Throw<DataError>("{}: expected a COLMAP model: cameras, images and points3D, all .bin or all .txt", folder.string());
}

// Intrinsic parameters alone.
Camera CameraOf(const colmap::CameraRecord& record, const std::string& where) {
  const auto& p = record.parameters;
  const auto expect = [&](size_t count) {
    if (p.size() != count) {
      Throw<DataError>("{}: expected {} parameters for model {}, found {}", where, count, record.model, p.size());
    }
  };
  Camera camera;
  camera.width = record.width;
  camera.height = record.height;
  const bool one_focal_length =
      record.model == "SIMPLE_PINHOLE" || record.model == "SIMPLE_RADIAL" || record.model == "RADIAL";
  if (one_focal_length) {
    expect(record.model == "SIMPLE_PINHOLE" ? 3 : record.model == "SIMPLE_RADIAL" ? 4 : 5);
    camera.focal_length = p[0];
    camera.principal_point = {p[1], p[2]};
    if (p.size() > 3) camera.radial_distortion[0] = p[3];
    if (p.size() > 4) camera.radial_distortion[1] = p[4];
  } else if (record.model == "PINHOLE" || record.model == "OPENCV") {
    expect(record.model == "PINHOLE" ? 4 : 8);
    camera.focal_length = p[0];
    camera.pixel_aspect_ratio = p[1] / p[0];
    camera.principal_point = {p[2], p[3]};
    if (p.size() == 8) {
      camera.radial_distortion = {p[4], p[5], 0};
      camera.tangential_distortion = {p[6], p[7]};
    }
  } else {
    Throw<DataError>(
        "{}: camera model {} is not supported; expected SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV "
        "(colmap "
        "image_undistorter turns any model into PINHOLE)",
        where, record.model);
  }
  return camera;
}

Mat3 RotationOf(const std::array<double, 4>& q, const std::string& where) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(norm > 1e-6) || !std::isfinite(norm)) Throw<DataError>("{}: its rotation is zero or not a number", where);
  const double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
           2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
           2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
}

}  // namespace

bool IsColmapModel(const fs::path& folder) { return HasAll(folder, ".bin") || HasAll(folder, ".txt"); }

ImportedModel ReadColmapModel(const fs::path& folder, const fs::path& image_folder) {
  const colmap::Files files = ReadFiles(folder);
  ImportedModel model;
  std::map<int64_t, int64_t> row_of;
  model.points = torch::empty({static_cast<int64_t>(files.points.size()), 3}, torch::kFloat64);
  auto* out = model.points.data_ptr<double>();
  double error_sum = 0;
  for (const auto& [id, point] : files.points) {
    row_of.emplace(id, static_cast<int64_t>(row_of.size()));
    for (const double value : {point.position.x, point.position.y, point.position.z}) *out++ = value;
    error_sum += point.error;
  }
  if (!model.points.isfinite().all().item<bool>()) {
    Throw<DataError>("{}: holds points that are not finite", (folder / "points3D").string());
  }
  if (!files.points.empty()) model.mean_reprojection_error = error_sum / static_cast<double>(files.points.size());

  for (const colmap::ImageRecord& image : files.images) {
    const std::string where = folder.string() + ": image " + image.name;
    const auto camera = files.cameras.find(image.camera);
    if (camera == files.cameras.end()) {
      Throw<DataError>("{}: names camera {}, which the model does not have", where, image.camera);
    }
    ImportedFrame frame;
    frame.name = image.name;
    frame.image_path = image_folder / image.name;
    frame.camera = CameraOf(camera->second, folder.string() + ": camera " + std::to_string(image.camera));
    frame.camera.orientation = RotationOf(image.rotation, where);
    frame.camera.position = -(frame.camera.orientation.Transposed() * image.translation);
    frame.camera.Check(where.c_str());
    for (const int64_t id : image.points) {
      const auto row = row_of.find(id);
      if (row == row_of.end()) Throw<DataError>("{}: observes point {}, which points3D does not have", where, id);
      frame.seen_points.push_back(row->second);
    }
    model.frames.push_back(std::move(frame));
  }
  std::sort(model.frames.begin(), model.frames.end(),
            [](const ImportedFrame& a, const ImportedFrame& b) { return a.name < b.name; });
  const auto twin = std::adjacent_find(model.frames.begin(), model.frames.end(),
                                       [](const ImportedFrame& a, const ImportedFrame& b) { return a.name == b.name; });
  if (twin != model.frames.end()) Throw<DataError>("{}: image {} is there twice", folder.string(), twin->name);
  return model;
}

int64_t CountColmapImages(const fs::path& folder) { return static_cast<int64_t>(ReadFiles(folder).images.size()); }

}  // namespace editnerf
