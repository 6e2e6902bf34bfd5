#include "libeditnerf/training/error_map.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr float kFollow = 0.1F;    // share by which a ray's error moves its cell's
constexpr float kUnknown = 0.01F;  // of a cell that no ray has met
constexpr float kLeast = 1e-6F;    // no cell is wholly forgotten

int64_t CellsIn(int64_t pixels) { return (pixels + ErrorMap::kCell - 1) / ErrorMap::kCell; }

// Pixels along one axis from the cell's first on.
int64_t PixelsIn(int64_t cell, int64_t pixels) { return std::min(ErrorMap::kCell, pixels - cell * ErrorMap::kCell); }

double RootOf(float missed) { return std::sqrt(std::max(missed, kLeast)); }

// `at` in [0, 1).
int64_t IndexAt(double at, int64_t size) {
  return std::min(size - 1, static_cast<int64_t>(at * static_cast<double>(size)));
}

}  // namespace

ErrorMap::ErrorMap(int64_t frames, int64_t height, int64_t width, double share)
    : frames_(frames),
      height_(height),
      width_(width),
      down_(CellsIn(height)),
      across_(CellsIn(width)),
      share_(share),
      missed_(static_cast<size_t>(frames * down_ * across_), kUnknown) {
  Settle();
}

int64_t ErrorMap::Bytes(int64_t frames, int64_t height, int64_t width) {
  return frames * CellsIn(height) * CellsIn(width) * static_cast<int64_t>(2 * sizeof(float) + sizeof(double));
}

int64_t ErrorMap::CellOf(int64_t pixel) const {
  const int64_t row = pixel / width_, frame = row / height_;
  return (frame * down_ + (row - frame * height_) / kCell) * across_ + pixel % width_ / kCell;
}

void ErrorMap::Learn(const torch::Tensor& pixel, const torch::Tensor& missed) {
  CheckShape(pixel, {kAny}, "pixel");
  CheckShape(missed, {pixel.size(0)}, "missed");
  const auto pixels = pixel.accessor<int64_t, 1>();
  const auto found = missed.accessor<float, 1>();
  for (int64_t i = 0; i < pixel.size(0); ++i) {
    if (!std::isfinite(found[i])) continue;
    float& mean = missed_[static_cast<size_t>(CellOf(pixels[i]))];
    mean += kFollow * (found[i] - mean);
  }
}

void ErrorMap::Settle() {
  settled_ = missed_;
  up_to_.resize(settled_.size());
  double sum = 0;
  size_t cell = 0;
  for (int64_t row = 0; row < frames_ * down_; ++row) {
    const int64_t height = PixelsIn(row % down_, height_);
    for (int64_t column = 0; column < across_; ++column, ++cell) {
      sum += RootOf(settled_[cell]) * static_cast<double>(height * PixelsIn(column, width_));
      up_to_[cell] = sum;
    }
  }
  mean_root_ = sum / static_cast<double>(std::max<int64_t>(frames_ * height_ * width_, 1));
}

torch::Tensor ErrorMap::Draw(int64_t count) const {
  const torch::Tensor random = torch::rand({count, 3}, torch::kFloat64);
  const auto at = random.accessor<double, 2>();
  torch::Tensor drawn = torch::empty({count}, torch::kInt64);
  auto pixels = drawn.accessor<int64_t, 1>();
  for (int64_t i = 0; i < count; ++i) {
    const auto found = std::upper_bound(up_to_.begin(), up_to_.end(), up_to_.back() * at[i][0]);
    const int64_t cell = std::min<int64_t>(found - up_to_.begin(), static_cast<int64_t>(up_to_.size()) - 1);
    const int64_t column = cell % across_, row = cell / across_ % down_, frame = cell / across_ / down_;
    const int64_t y = row * kCell + IndexAt(at[i][1], PixelsIn(row, height_));
    const int64_t x = column * kCell + IndexAt(at[i][2], PixelsIn(column, width_));
    pixels[i] = (frame * height_ + y) * width_ + x;
  }
  return drawn;
}

torch::Tensor ErrorMap::Emphasis(const torch::Tensor& pixel) const {
  CheckShape(pixel, {kAny}, "pixel");
  torch::Tensor emphasis = torch::empty({pixel.size(0)}, torch::kFloat32);
  const auto pixels = pixel.accessor<int64_t, 1>();
  auto counts_for = emphasis.accessor<float, 1>();
  for (int64_t i = 0; i < pixel.size(0); ++i) {
    const double chance = RootOf(settled_[static_cast<size_t>(CellOf(pixels[i]))]) / mean_root_;
    counts_for[i] = static_cast<float>(1 / (1 - share_ + share_ * chance));
  }
  return emphasis;
}

torch::Tensor ErrorMap::State() const {
  return torch::stack({torch::tensor(settled_), torch::tensor(missed_)}).view({2, frames_, down_, across_});
}

void ErrorMap::SetState(const torch::Tensor& state) {
  CheckShape(state, {2, frames_, down_, across_}, "error map");
  const torch::Tensor values = state.to(torch::kCPU, torch::kFloat32).contiguous();
  if (!values.isfinite().logical_and(values >= 0).all().item<bool>()) {
    Throw<CheckpointError>("error map: expected mean squared errors, found values that are negative or not finite");
  }
  const auto take = [&](int64_t which, std::vector<float>* to) {
    std::copy_n(values[which].data_ptr<float>(), to->size(), to->begin());
  };
  take(0, &missed_);
  Settle();
  take(1, &missed_);
}

}  // namespace editnerf
