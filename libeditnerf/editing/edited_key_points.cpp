#include "libeditnerf/editing/edited_key_points.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

torch::Tensor AsTensor(const Vec3& point) { return torch::tensor({point.x, point.y, point.z}, torch::kFloat64); }

// Whether key point `index` is named; throws where it is and does not exist.
bool IsNamed(const NamedKeyPoints& named, size_t index, int64_t count) {
  if (!named[index]) return false;
  if (static_cast<int64_t>(index) >= count) {
    Throw<DataError>("edit: key point {} is named, but there are only {}, numbered from 0", index, count);
  }
  return true;
}

}  // namespace

torch::Tensor EditedKeyPoints(const NamedKeyPoints& named, const torch::Tensor& key_points) {
  CheckShape(key_points, {kAny, 3}, "key_points");
  torch::NoGradGuard no_grad;
  auto edited = key_points.detach().clone();
  for (size_t i = 0; i < named.size(); ++i) {
    if (IsNamed(named, i, key_points.size(0))) edited.select(0, static_cast<int64_t>(i)).copy_(AsTensor(*named[i]));
  }
  return edited;
}

NearestRow NearestKeyPoints(const NamedKeyPoints& named, const torch::Tensor& tracks) {
  CheckShape(tracks, {kAny, kAny, 3}, "tracks");
  torch::NoGradGuard no_grad;
  const auto known = tracks.detach().to(torch::kCPU, torch::kFloat64);
  auto squares = torch::zeros({known.size(0)}, torch::kFloat64);
  bool any = false;
  for (size_t i = 0; i < named.size(); ++i) {
    if (!IsNamed(named, i, known.size(1))) continue;
    squares += (known.select(1, static_cast<int64_t>(i)) - AsTensor(*named[i])).square().sum(1);
    any = true;
  }
  if (!any) Throw<DataError>("edit: no key point is named; give a position or a code_frame");
  const int64_t row = squares.argmin().item<int64_t>();
  return {row, std::sqrt(squares[row].item<double>())};
}

}  // namespace editnerf
