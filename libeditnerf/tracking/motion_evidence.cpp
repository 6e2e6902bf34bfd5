#include "libeditnerf/tracking/motion_evidence.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libeditnerf/base/parallel.h"

namespace editnerf {
namespace {

constexpr int64_t kCellAt320 = 4;
constexpr double kLeastDistance = 0.75;  // pixels at 320 wide
constexpr double kNoiseFactor = 4;
constexpr int64_t kFlowSupport = 5;  // pixels over which dense flow mixes neighbouring motions

// Nearest and farthest surface around a pixel; NaN where there is none.
struct DepthRange {
  double near = NAN, far = NAN;
};

DepthRange DepthsAround(const torch::Tensor& depth, const Pixel& p) {
  const int64_t height = depth.size(0), width = depth.size(1);
  const float* values = depth.data_ptr<float>();
  const auto column = static_cast<int64_t>(p.u), row = static_cast<int64_t>(p.v);
  DepthRange range;
  for (int64_t r = std::max<int64_t>(row - kFlowSupport, 0); r <= std::min(row + kFlowSupport, height - 1); r += 2) {
    for (int64_t c = std::max<int64_t>(column - kFlowSupport, 0); c <= std::min(column + kFlowSupport, width - 1);
         c += 2) {
      range.near = std::fmin(range.near, values[r * width + c]);
      range.far = std::fmax(range.far, values[r * width + c]);
    }
  }
  return std::isfinite(range.near) && std::isfinite(range.far) ? range : DepthRange{};
}

double DistanceToSegment(const Pixel& p, const Pixel& a, const Pixel& b) {
  const double du = b.u - a.u, dv = b.v - a.v, squared = du * du + dv * dv;
  const double share = squared > 0 ? std::clamp(((p.u - a.u) * du + (p.v - a.v) * dv) / squared, 0.0, 1.0) : 0.0;
  return Distance(p, {a.u + share * du, a.v + share * dv});
}

// Largest distance between the flow's chain from (t, p) and the projections of static points; NaN if unknown.
double Deviation(const Clip& clip, int64_t t, const Pixel& p, int64_t reach) {
  const DepthRange range = DepthsAround(clip.depth[static_cast<size_t>(t)], p);
  if (std::isnan(range.near)) return NAN;
  const Vec3 near = clip.Lift(t, p, range.near), far = clip.Lift(t, p, range.far);
  double largest = NAN;
  for (const int64_t step : {int64_t{1}, int64_t{-1}}) {
    Pixel chained = p;
    for (int64_t s = t; std::abs(s - t) < reach; s += step) {
      const FlowSample flow = clip.Step(s, step, chained);
      if (!flow.checked) break;
      chained = {chained.u + flow.du, chained.v + flow.dv};
      if (!clip.Inside(chained)) break;
      const Camera& camera = clip.cameras[static_cast<size_t>(s + step)];
      const Projected still_near = Project(camera, near), still_far = Project(camera, far);
      if (!still_near.valid || !still_far.valid) break;
      largest =
          std::fmax(largest, DistanceToSegment(chained, {still_near.u, still_near.v}, {still_far.u, still_far.v}));
    }
  }
  return largest;
}

double Median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::nth_element(values.begin(), values.begin() + static_cast<int64_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace

double MotionEvidence::At(int64_t t, const Pixel& p) const {
  const int64_t rows = ratio.size(1), columns = ratio.size(2);
  const auto row = static_cast<int64_t>(p.v) / cell, column = static_cast<int64_t>(p.u) / cell;
  const float* values = ratio.data_ptr<float>() + t * rows * columns;
  std::vector<double> known;
  for (int64_t r = std::max<int64_t>(row - 1, 0); r <= std::min(row + 1, rows - 1); ++r)
    for (int64_t c = std::max<int64_t>(column - 1, 0); c <= std::min(column + 1, columns - 1); ++c)
      if (std::isfinite(values[r * columns + c])) known.push_back(values[r * columns + c]);
  return known.empty() ? 0 : Median(known);
}

MotionEvidence MeasureMotion(const Clip& clip) {
  MotionEvidence evidence;
  evidence.cell = std::max<int64_t>(2, std::llround(kCellAt320 * clip.PixelScale()));
  const int64_t frames = clip.num_frames();
  const int64_t rows = (clip.height + evidence.cell - 1) / evidence.cell;
  const int64_t columns = (clip.width + evidence.cell - 1) / evidence.cell;
  const int64_t reach = std::clamp<int64_t>(frames / 10, 4, 16);
  evidence.ratio = torch::full({frames, rows, columns}, NAN, torch::kFloat32);
  float* ratio = evidence.ratio.data_ptr<float>();
  ParallelFor(frames, 1, [&](int64_t begin, int64_t end) {
    for (int64_t t = begin; t < end; ++t) {
      std::vector<double> known;
      float* cells = ratio + t * rows * columns;
      for (int64_t i = 0; i < rows * columns; ++i) {
        const auto half = static_cast<double>(evidence.cell) / 2;
        const Pixel center = {static_cast<double>(i % columns * evidence.cell) + half,
                              static_cast<double>(i / columns * evidence.cell) + half};
        cells[i] = static_cast<float>(Deviation(clip, t, center, reach));
        if (std::isfinite(cells[i])) known.push_back(cells[i]);
      }
      if (known.empty()) continue;
      const auto threshold =
          static_cast<float>(std::max(kLeastDistance * clip.PixelScale(), kNoiseFactor * Median(known)));
      for (int64_t i = 0; i < rows * columns; ++i) cells[i] /= threshold;
    }
  });
  return evidence;
}

}  // namespace editnerf
