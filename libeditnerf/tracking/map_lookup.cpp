#include "libeditnerf/tracking/map_lookup.h"

#include <algorithm>

namespace editnerf {

FlowSample SampleFlow(const torch::Tensor& flow, const torch::Tensor& mask, const Pixel& p) {
  const int64_t height = flow.size(0), width = flow.size(1);
  FlowSample sample;
  if (!std::isfinite(p.u) || !std::isfinite(p.v) || !InsideImage(p, width, height)) return sample;
  const double x = p.u - 0.5, y = p.v - 0.5;
  const double x0 = std::floor(x), y0 = std::floor(y);
  const float* values = flow.data_ptr<float>();
  const bool* valid = mask.defined() ? mask.data_ptr<bool>() : nullptr;
  double du = 0, dv = 0, finite = 0, backed = 0, backed_du = 0, backed_dv = 0;
  for (int corner = 0; corner < 4; ++corner) {
    const int dx = corner & 1, dy = corner >> 1;
    const double weight = (dx ? x - x0 : 1 - (x - x0)) * (dy ? y - y0 : 1 - (y - y0));
    const int64_t column = std::clamp<int64_t>(static_cast<int64_t>(x0) + dx, 0, width - 1);
    const int64_t row = std::clamp<int64_t>(static_cast<int64_t>(y0) + dy, 0, height - 1);
    const int64_t index = row * width + column;
    const double fu = values[2 * index], fv = values[2 * index + 1];
    if (!std::isfinite(fu) || !std::isfinite(fv)) continue;
    finite += weight;
    du += weight * fu;
    dv += weight * fv;
    if (valid && !valid[index]) continue;
    backed += weight;
    backed_du += weight * fu;
    backed_dv += weight * fv;
  }
  if (finite < 0.5) return sample;
  sample.valid = true;
  sample.checked = backed >= 0.5;
  sample.du = sample.checked ? backed_du / backed : du / finite;
  sample.dv = sample.checked ? backed_dv / backed : dv / finite;
  return sample;
}

double LocalDepth(const torch::Tensor& depth, const Pixel& p, int64_t radius, double expected, double gap) {
  const int64_t height = depth.size(0), width = depth.size(1);
  if (!std::isfinite(p.u) || !std::isfinite(p.v) || !InsideImage(p, width, height)) return NAN;
  const float* values = depth.data_ptr<float>();
  const auto column = static_cast<int64_t>(p.u), row = static_cast<int64_t>(p.v);
  std::vector<double> found;
  found.reserve(static_cast<size_t>((2 * radius + 1) * (2 * radius + 1)));
  for (int64_t r = std::max<int64_t>(row - radius, 0); r <= std::min(row + radius, height - 1); ++r) {
    for (int64_t c = std::max<int64_t>(column - radius, 0); c <= std::min(column + radius, width - 1); ++c) {
      const double value = values[r * width + c];
      if (std::isfinite(value)) found.push_back(value);
    }
  }
  if (found.empty()) return NAN;
  std::sort(found.begin(), found.end());
  const size_t least = (found.size() + 3) / 4;
  double best = NAN, best_distance = std::numeric_limits<double>::infinity();
  size_t begin = 0;
  for (size_t end = 1; end <= found.size(); ++end) {
    if (end < found.size() && found[end] - found[end - 1] <= gap * found[end - 1]) continue;
    const double median = found[begin + (end - begin) / 2];
    if (std::isnan(expected)) {
      if (end - begin >= least) return median;
    } else if (std::abs(median - expected) < best_distance) {
      best_distance = std::abs(median - expected);
      best = median;
    }
    begin = end;
  }
  return std::isnan(best) ? found[found.size() / 2] : best;
}

}  // namespace editnerf
