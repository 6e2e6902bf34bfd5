#include "libeditnerf/imaging/importers/llff.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/npy_file.h"

namespace editnerf {
namespace fs = std::filesystem;

std::vector<fs::path> ListImages(const fs::path& folder) {
  if (!fs::is_directory(folder)) Throw<DataError>("{}: no such folder; expected a folder of images", folder.string());
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && HasImageExtension(entry.path()) && entry.path().filename().string()[0] != '.') {
      images.push_back(entry.path());
    }
  }
  std::sort(images.begin(), images.end());
  return images;
}

ImportedModel ReadLlffPoses(const fs::path& path, const fs::path& image_folder) {
  const torch::Tensor file = ReadNpy(path);
  if (file.dim() != 2 || file.size(1) != 17 || !file.is_floating_point() || file.size(0) < 1) {
    Throw<DataError>("{}: expected [F, 17] floating point numbers, found {}", path.string(), ShapeString(file));
  }
  const torch::Tensor rows = file.to(torch::kFloat64).contiguous();
  const std::vector<fs::path> images = ListImages(image_folder);
  if (static_cast<int64_t>(images.size()) != rows.size(0)) {
    Throw<DataError>("{}: holds {} poses, but {} has {} images; expected one pose per image", path.string(),
                     rows.size(0), image_folder.string(), images.size());
  }
  ImportedModel model;
  for (size_t i = 0; i < images.size(); ++i) {
    const double* p = rows.data_ptr<double>() + 17 * i;
    const std::string where = path.string() + ": row " + std::to_string(i);
    for (int k = 0; k < 17; ++k) {
      if (!std::isfinite(p[k])) Throw<DataError>("{}: expected finite numbers, found {}", where, p[k]);
    }
    if (!(p[15] > 0 && p[15] < p[16])) {
      Throw<DataError>("{}: expected 0 < nearest < farthest depth, found {} and {}", where, p[15], p[16]);
    }
    const double height = p[4], width = p[9];
    if (!(width >= 1 && width <= 65536 && height >= 1 && height <= 65536)) {
      Throw<DataError>("{}: expected an image size of 1 to 65536 pixels, found {} x {}", where, width, height);
    }
    ImportedFrame frame;
    frame.name = images[i].filename().string();
    frame.image_path = images[i];
    Camera& camera = frame.camera;
    camera.height = std::llround(height);
    camera.width = std::llround(width);
    camera.focal_length = p[14];
    camera.principal_point = {0.5 * width, 0.5 * height};
    const Mat3 camera_from_world = {{p[1], p[6], p[11], p[0], p[5], p[10], -p[2], -p[7], -p[12]}};
    camera.orientation = NearestRotation(camera_from_world, where);
    camera.position = {p[3], p[8], p[13]};
    camera.Check(where.c_str());
    frame.near = p[15];
    frame.far = p[16];
    model.frames.push_back(std::move(frame));
  }
  return model;
}

}  // namespace editnerf
