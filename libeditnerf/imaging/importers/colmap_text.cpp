#include <exception>
#include <sstream>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/imaging/importers/colmap_files.h"

namespace editnerf::colmap {
namespace {

// The lines of a text file without comments; empty lines stay, because images.txt uses them.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& path) : where_(path.string()), stream_(ReadFile(path)) {}

  bool Next() {
    std::string line;
    while (std::getline(stream_, line)) {
      ++number_;
      if (!line.empty() && line[0] == '#') continue;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      fields_.clear();
      std::istringstream words(line);
      for (std::string word; words >> word;) fields_.push_back(word);
      return true;
    }
    return false;
  }
  bool empty() const { return fields_.empty(); }
  size_t size() const { return fields_.size(); }

  const std::string& Word(size_t i) const {
    if (i >= fields_.size()) {
      Throw<DataError>("{}:{}: expected more than {} fields", where_, number_, fields_.size());
    }
    return fields_[i];
  }
  double Number(size_t i) const {
    const std::string& word = Word(i);
    try {
      size_t used = 0;
      const double value = std::stod(word, &used);
      if (used == word.size()) return value;
    } catch (const std::exception&) {
    }
    Throw<DataError>("{}:{}: expected a number, found '{}'", where_, number_, word);
  }
  int64_t Integer(size_t i) const {
    const double value = Number(i);
    if (!(value >= -1 && value < 1e15) || value != static_cast<double>(static_cast<int64_t>(value))) {
      Throw<DataError>("{}:{}: expected a whole number, found '{}'", where_, number_, Word(i));
    }
    return static_cast<int64_t>(value);
  }
  Vec3 Point(size_t i) const { return {Number(i), Number(i + 1), Number(i + 2)}; }

 private:
  std::string where_;
  std::istringstream stream_;
  std::vector<std::string> fields_;
  int64_t number_ = 0;
};

}  // namespace

Files ReadText(const std::filesystem::path& folder) {
  Files files;
  Lines cameras(folder / "cameras.txt");
  while (cameras.Next()) {
    if (cameras.empty()) continue;
    CameraRecord& camera = files.cameras[cameras.Integer(0)];
    camera.model = cameras.Word(1);
    camera.width = cameras.Integer(2);
    camera.height = cameras.Integer(3);
    for (size_t i = 4; i < cameras.size(); ++i) camera.parameters.push_back(cameras.Number(i));
  }
  Lines images(folder / "images.txt");
  while (images.Next()) {
    if (images.empty()) continue;
    ImageRecord image;
    for (size_t i = 0; i < 4; ++i) image.rotation[i] = images.Number(i + 1);
    image.translation = images.Point(5);
    image.camera = images.Integer(8);
    image.name = images.Word(9);
    for (size_t i = 10; i < images.size(); ++i) image.name += " " + images.Word(i);
    if (images.Next()) {  // x y point, repeated; the line may be empty
      for (size_t i = 2; i < images.size(); i += 3) {
        if (images.Integer(i) >= 0) image.points.push_back(images.Integer(i));
      }
    }
    files.images.push_back(std::move(image));
  }
  Lines points(folder / "points3D.txt");
  while (points.Next()) {
    if (points.empty()) continue;
    files.points[points.Integer(0)] = {points.Point(1), points.Number(7)};
  }
  return files;
}

}  // namespace editnerf::colmap
