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

// Largest distance between the flow's chain from (t, p) and the projections of the static point; NaN if unknown.
double Deviation(const Clip& clip, int64_t t, const Pixel& p, int64_t reach) {
  const double depth = LocalDepth(clip.depth[static_cast<size_t>(t)], p, 0);
  if (!std::isfinite(depth)) return NAN;
  const Vec3 point = clip.Lift(t, p, depth);
  double largest = NAN;
  for (const int64_t step : {int64_t{1}, int64_t{-1}}) {
    Pixel chained = p;
    for (int64_t s = t; std::abs(s - t) < reach; s += step) {
      const FlowSample flow = clip.Step(s, step, chained);
      if (!flow.checked) break;
      chained = {chained.u + flow.du, chained.v + flow.dv};
      if (!clip.Inside(chained)) break;
      const Projected still = Project(clip.cameras[static_cast<size_t>(s + step)], point);
      if (!still.valid) break;
      largest = std::fmax(largest, Distance(chained, {still.u, still.v}));
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
      const auto threshold = static_cast<float>(std::max(kLeastDistance * clip.PixelScale(), kNoiseFactor * Median(known)));
      for (int64_t i = 0; i < rows * columns; ++i) cells[i] /= threshold;
    }
  });
  return evidence;
}

}  // namespace editnerf
