#include "libeditnerf/geometry/image_lookup.h"

#include <algorithm>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

// One axis: the lower neighbour's index, the upper one's, and the upper one's weight.
struct Axis {
  torch::Tensor low, high, fraction;

  Axis(const torch::Tensor& position, int64_t size) {
    const torch::Tensor grid = (position - 0.5).clamp(0.0, static_cast<double>(size - 1));
    low = grid.detach().to(torch::kInt64).clamp(0, std::max<int64_t>(size - 2, 0));  // grid >= 0: truncation is floor
    high = (low + 1).clamp_max(size - 1);
    fraction = (grid - low.to(grid.scalar_type())).unsqueeze(-1);
  }
};

}  // namespace

LookedUp BilinearLookUp(const torch::Tensor& image, const torch::Tensor& frame, const torch::Tensor& pixel) {
  if (image.defined() && image.dim() == 3) return BilinearLookUp(image.unsqueeze(-1), frame, pixel);
  CheckShape(image, {kAny, kAny, kAny, kAny}, "image");
  CheckShape(frame, {kAny}, "frame");
  CheckShape(pixel, {frame.size(0), 2}, "pixel");
  if (!image.is_floating_point()) Throw<ShapeError>("image: expected floating-point values");
  const int64_t height = image.size(1), width = image.size(2);
  const torch::Tensor inside = (pixel.select(-1, 0) >= 0) & (pixel.select(-1, 0) <= static_cast<double>(width)) &
                               (pixel.select(-1, 1) >= 0) & (pixel.select(-1, 1) <= static_cast<double>(height));
  const torch::Tensor position = torch::where(inside.unsqueeze(-1), pixel, torch::zeros_like(pixel));
  const Axis x(position.select(-1, 0), width), y(position.select(-1, 1), height);

  const torch::Tensor entries = image.reshape({-1, image.size(3)});
  LookedUp found{{}, inside};
  const auto tap = [&](const torch::Tensor& row, const torch::Tensor& column) {
    const torch::Tensor value = entries.index_select(0, (frame * height + row) * width + column);
    const torch::Tensor finite = value.isfinite();
    found.valid = found.valid & finite.all(-1);
    return torch::where(finite, value, torch::zeros_like(value));
  };
  const torch::Tensor v00 = tap(y.low, x.low), v01 = tap(y.low, x.high);
  const torch::Tensor v10 = tap(y.high, x.low), v11 = tap(y.high, x.high);
  const torch::Tensor top = v00 + (v01 - v00) * x.fraction, bottom = v10 + (v11 - v10) * x.fraction;
  const torch::Tensor value = top + (bottom - top) * y.fraction;
  found.value = torch::where(found.valid.unsqueeze(-1), value, torch::zeros_like(value));
  return found;
}

}  // namespace editnerf
