#include <cstring>
#include <iterator>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/imaging/importers/colmap_files.h"

namespace editnerf::colmap {
namespace {

struct Model {
  const char* name;
  size_t parameters;
};
// In the order of COLMAP's numbers.
constexpr Model kModels[] = {{"SIMPLE_PINHOLE", 3},
                             {"PINHOLE", 4},
                             {"SIMPLE_RADIAL", 4},
                             {"RADIAL", 5},
                             {"OPENCV", 8},
                             {"OPENCV_FISHEYE", 8},
                             {"FULL_OPENCV", 12},
                             {"FOV", 5},
                             {"SIMPLE_RADIAL_FISHEYE", 4},
                             {"RADIAL_FISHEYE", 5},
                             {"THIN_PRISM_FISHEYE", 12}};

// Little-endian records with bounds checks.
class Cursor {
 public:
  explicit Cursor(const std::filesystem::path& path) : where_(path.string()), content_(ReadFile(path)) {}

  template <class T>
  T Get() {
    if (Left() < sizeof(T)) Throw<DataError>("{}: ends inside a record; the file is truncated", where_);
    T value;
    std::memcpy(&value, content_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  // A number of records of at least `record_size` bytes each.
  size_t Count(size_t record_size) {
    const auto count = Get<uint64_t>();
    if (count > Left() / record_size) {
      Throw<DataError>("{}: announces {} records, but only {} bytes follow; the file is truncated or damaged", where_,
                       count, Left());
    }
    return static_cast<size_t>(count);
  }
  std::string Name() {
    const size_t end = content_.find('\0', at_);
    if (end == std::string::npos) Throw<DataError>("{}: ends inside a name; the file is truncated", where_);
    std::string name = content_.substr(at_, end - at_);
    at_ = end + 1;
    return name;
  }
  void Skip(size_t bytes) {
    if (bytes > Left()) Throw<DataError>("{}: ends inside a record; the file is truncated", where_);
    at_ += bytes;
  }
  const std::string& where() const { return where_; }

 private:
  size_t Left() const { return content_.size() - at_; }

  std::string where_, content_;
  size_t at_ = 0;
};

void ReadCameras(const std::filesystem::path& path, Files* files) {
  Cursor cursor(path);
  const size_t count = cursor.Count(24);
  for (size_t i = 0; i < count; ++i) {
    const auto id = cursor.Get<uint32_t>();
    const auto model = cursor.Get<int32_t>();
    if (model < 0 || model >= static_cast<int32_t>(std::size(kModels))) {
      Throw<DataError>("{}: camera {}: unknown camera model number {}", cursor.where(), id, model);
    }
    CameraRecord camera;
    camera.model = kModels[model].name;
    camera.width = static_cast<int64_t>(cursor.Get<uint64_t>());
    camera.height = static_cast<int64_t>(cursor.Get<uint64_t>());
    for (size_t p = 0; p < kModels[model].parameters; ++p) camera.parameters.push_back(cursor.Get<double>());
    if (!files->cameras.emplace(id, camera).second)
      Throw<DataError>("{}: camera {} is there twice", cursor.where(), id);
  }
}

void ReadImages(const std::filesystem::path& path, Files* files) {
  Cursor cursor(path);
  const size_t count = cursor.Count(73);
  for (size_t i = 0; i < count; ++i) {
    ImageRecord image;
    cursor.Get<uint32_t>();
    for (double& q : image.rotation) q = cursor.Get<double>();
    image.translation.x = cursor.Get<double>();
    image.translation.y = cursor.Get<double>();
    image.translation.z = cursor.Get<double>();
    image.camera = cursor.Get<uint32_t>();
    image.name = cursor.Name();
    const size_t observations = cursor.Count(24);
    for (size_t o = 0; o < observations; ++o) {
      cursor.Skip(16);  // pixel position
      const auto point = static_cast<int64_t>(cursor.Get<uint64_t>());
      if (point >= 0) image.points.push_back(point);  // all bits set: not triangulated
    }
    files->images.push_back(std::move(image));
  }
}

void ReadPoints(const std::filesystem::path& path, Files* files) {
  Cursor cursor(path);
  const size_t count = cursor.Count(51);
  for (size_t i = 0; i < count; ++i) {
    const auto id = static_cast<int64_t>(cursor.Get<uint64_t>());
    PointRecord point;
    point.position.x = cursor.Get<double>();
    point.position.y = cursor.Get<double>();
    point.position.z = cursor.Get<double>();
    cursor.Skip(3);  // colour
    point.error = cursor.Get<double>();
    const size_t track = cursor.Count(8);
    cursor.Skip(8 * track);
    if (!files->points.emplace(id, point).second) Throw<DataError>("{}: point {} is there twice", cursor.where(), id);
  }
}

}  // namespace

Files ReadBinary(const std::filesystem::path& folder) {
  Files files;
  ReadCameras(folder / "cameras.bin", &files);
  ReadImages(folder / "images.bin", &files);
  ReadPoints(folder / "points3D.bin", &files);
  return files;
}

}  // namespace editnerf::colmap
