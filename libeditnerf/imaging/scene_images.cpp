#include "libeditnerf/imaging/scene_images.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/imaging/image_file.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

struct Size {
  int64_t width, height;
};

Size SizeOf(const torch::Tensor& image) { return {image.size(1), image.size(0)}; }
bool operator==(const Size& a, const Size& b) { return a.width == b.width && a.height == b.height; }

int64_t Rounded(int64_t side, int64_t factor) {
  return std::max<int64_t>(1, std::llround(static_cast<double>(side) / static_cast<double>(factor)));
}

// Other tools round down or up where the side is not a multiple of the factor.
bool WithinAPixel(const Size& size, const Size& full, int64_t factor) {
  const auto near = [factor](int64_t side, int64_t full_side) {
    return std::abs(static_cast<double>(side) - static_cast<double>(full_side) / static_cast<double>(factor)) < 1;
  };
  return near(size.width, full.width) && near(size.height, full.height);
}

fs::path ImagePath(const fs::path& folder, int64_t factor, const std::string& id) {
  return folder / "rgb" / (std::to_string(factor) + "x") / (id + ".png");
}

torch::Tensor FullImage(const fs::path& folder, const std::string& id, const Size& full, int64_t factor) {
  const fs::path path = ImagePath(folder, 1, id);
  if (!fs::exists(path)) {
    const std::string other = factor > 1 ? " (nor " + ImagePath(folder, factor, id).string() + ")" : "";
    Throw<DataError>("{}: no such image{}; dataset.json names it, so it must be there", path.string(), other);
  }
  torch::Tensor image = ReadImage(path);
  const Size size = SizeOf(image);
  if (!(size == full)) {
    Throw<DataError>("{}: {} x {} pixels, expected {} x {} as the camera files say; all frames must have one size",
                     path.string(), size.width, size.height, full.width, full.height);
  }
  return image;
}

}  // namespace

int64_t ImageFactor(const DataConfig& config, int64_t full_width, int64_t full_height) {
  if (config.image_factor > 0) return config.image_factor;
  return (std::max(full_width, full_height) + config.max_side - 1) / config.max_side;
}

torch::Tensor ReadSceneImages(const fs::path& folder, const std::vector<std::string>& ids, int64_t full_width,
                              int64_t full_height, int64_t factor) {
  const Size full = {full_width, full_height};
  Size size = {Rounded(full_width, factor), Rounded(full_height, factor)};
  // One image has to have the size that the camera files announce before memory is taken for all.
  if (!ids.empty()) {
    const fs::path scaled = ImagePath(folder, factor, ids[0]);
    const Size found = factor > 1 && fs::exists(scaled) ? SizeOf(ReadImage(scaled)) : Size{0, 0};
    if (factor > 1 && WithinAPixel(found, full, factor)) {
      size = found;
    } else {
      FullImage(folder, ids[0], full, factor);
    }
  }
  const auto count = static_cast<int64_t>(ids.size());
  torch::Tensor images = torch::empty({count, size.height, size.width, 3}, torch::kUInt8);
  const int64_t bytes = size.height * size.width * 3;
  auto* out = images.data_ptr<uint8_t>();
  ParallelFor(count, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const std::string& id = ids[static_cast<size_t>(i)];
      torch::Tensor image;
      if (factor > 1 && fs::exists(ImagePath(folder, factor, id))) image = ReadImage(ImagePath(folder, factor, id));
      if (!image.defined() || !(SizeOf(image) == size)) {
        image = FullImage(folder, id, full, factor);
        if (factor > 1) image = ResizeByArea(image, size.height, size.width);
      }
      std::memcpy(out + i * bytes, image.data_ptr<uint8_t>(), static_cast<size_t>(bytes));
    }
  });
  return images;
}

torch::Tensor ResizeByNearest(const torch::Tensor& images, int64_t new_height, int64_t new_width) {
  const auto sources = [](int64_t old_size, int64_t new_size) {
    const double ratio = static_cast<double>(old_size) / static_cast<double>(new_size);
    torch::Tensor index = torch::empty({new_size}, torch::kInt64);
    for (int64_t i = 0; i < new_size; ++i) {
      const auto source = static_cast<int64_t>((static_cast<double>(i) + 0.5) * ratio);
      index.data_ptr<int64_t>()[i] = std::min(source, old_size - 1);
    }
    return index;
  };
  const int64_t height = images.size(-2), width = images.size(-1);
  if (height == new_height && width == new_width) return images;
  return images.index_select(-2, sources(height, new_height)).index_select(-1, sources(width, new_width));
}

}  // namespace editnerf
