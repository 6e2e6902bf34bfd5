#include "libeditnerf/tracking/still_flow.h"

#include <cmath>
#include <limits>

#include "libeditnerf/base/shape.h"

namespace editnerf {

torch::Tensor StillFlow(const Camera& from, const torch::Tensor& depth, const Camera& to) {
  CheckShape(depth, {kAny, kAny}, "depth");
  const torch::Tensor distances = depth.to(torch::kFloat32).contiguous();
  const int64_t height = depth.size(0), width = depth.size(1);
  torch::Tensor flow = torch::full({height, width, 2}, std::numeric_limits<float>::quiet_NaN());
  const float* distance = distances.data_ptr<float>();
  float* out = flow.data_ptr<float>();
  for (int64_t row = 0; row < height; ++row) {
    for (int64_t column = 0; column < width; ++column, ++distance, out += 2) {
      if (!std::isfinite(*distance)) continue;
      const double u = static_cast<double>(column) + 0.5, v = static_cast<double>(row) + 0.5;
      const Projected there = Project(to, from.position + from.DirectionThrough(u, v) * *distance);
      if (!there.valid) continue;
      out[0] = static_cast<float>(there.u - u);
      out[1] = static_cast<float>(there.v - v);
    }
  }
  const torch::Tensor median = torch::nan_to_num(std::get<0>(torch::nanmedian(flow.view({-1, 2}), 0)), 0.0);
  return torch::where(flow.isnan(), median.expand_as(flow), flow);
}

}  // namespace editnerf
