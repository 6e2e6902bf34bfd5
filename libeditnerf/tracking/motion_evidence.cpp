#include "libeditnerf/tracking/motion_evidence.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {
namespace {

constexpr int64_t kCellAt320 = 4;
constexpr double kLeastDistance = 0.75;  // pixels at 320 wide
constexpr double kNoiseFactor = 4;
constexpr int64_t kFlowSupport = 5;  // pixels over which dense flow mixes neighbouring motions
constexpr double kMostUncertain = 4;
constexpr double kUncertaintyQuantile = 0.9;

// Nearest and farthest surface around a pixel; NaN where there is none.
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

DepthRange Widened(const DepthRange& range, double share) {
  return {range.near / (1 + share), range.far * (1 + share)};
}

// What the cells of one frame are measured against.
struct Cells {
  int64_t size, rows, columns, reach;

  Pixel Center(int64_t row, int64_t column) const {
    const auto half = static_cast<double>(size) / 2;
    return {static_cast<double>(column * size) + half, static_cast<double>(row * size) + half};
  }
};

// How far the depth maps are off where the scene stands still: the share of the depth that explains most of what moves
// against them. Depths of a real capture, whose walls have no texture, may be a tenth wrong; those of a synthetic scene
// are not.
double DepthUncertainty(const Clip& clip, const Cells& cells) {
  constexpr int64_t kStride = 3;
  const int64_t frames = clip.num_frames();
  std::vector<std::vector<double>> found(static_cast<size_t>(frames));
  ParallelFor(frames, 1, [&](int64_t begin, int64_t end) {
    for (int64_t t = begin; t < end; ++t) {
      for (int64_t i = 0; i < cells.rows * cells.columns; i += kStride) {
        const Pixel p = cells.Center(i / cells.columns, i % cells.columns);
        const auto frame = static_cast<size_t>(t);
        const Texture texture = TextureAround(clip.gray[frame], p);
        const DepthRange range = DepthsAround(clip.depth[frame], p);
        if (std::isnan(range.near) || !texture.Enough()) continue;
        const Chain chain = FollowFlow(clip, t, p, cells.reach);
        if (chain.empty()) continue;
        const StillPoint mapped = FindStillPoint(clip, t, p, range, chain, texture);
        if (!(mapped.miss > kLeastDistance * clip.PixelScale())) {
          found[frame].push_back(0);
          continue;
        }
        const StillPoint free = FindStillPoint(clip, t, p, Widened(range, kMostUncertain), chain, texture);
        if (!(free.miss < 0.5 * mapped.miss)) continue;  // it moves
        found[frame].push_back(std::max(range.near / free.distance, free.distance / range.far) - 1);
      }
    }
  });
  std::vector<double> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  if (all.empty()) return 0;
  const auto at = all.begin() + static_cast<int64_t>(kUncertaintyQuantile * static_cast<double>(all.size() - 1));
  std::nth_element(all.begin(), at, all.end());
  return std::max(*at, 0.0);
}

// How far the flow's chain from (t, p) misses every static point within the depths around; NaN if unknown.
double Deviation(const Clip& clip, int64_t t, const Pixel& p, int64_t reach, double uncertainty) {
  const DepthRange range = DepthsAround(clip.depth[static_cast<size_t>(t)], p);
  const Texture texture = TextureAround(clip.gray[static_cast<size_t>(t)], p);
  if (std::isnan(range.near) || !texture.Enough()) return NAN;
  const Chain chain = FollowFlow(clip, t, p, reach);
  return chain.empty() ? NAN : FindStillPoint(clip, t, p, Widened(range, uncertainty), chain, texture).miss;
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
  return Percentile(known, 0.5);
}

torch::Tensor MotionEvidence::MovingPixels(int64_t height, int64_t width) const {
  const int64_t frames = ratio.size(0), rows = ratio.size(1), columns = ratio.size(2);
  const torch::Tensor cells = torch::zeros({frames, rows, columns}, torch::kBool);
  bool* moves = cells.data_ptr<bool>();
  const double half = static_cast<double>(cell) / 2;
  for (int64_t t = 0; t < frames; ++t) {
    for (int64_t row = 0; row < rows; ++row) {
      for (int64_t column = 0; column < columns; ++column) {
        const Pixel center = {static_cast<double>(column * cell) + half, static_cast<double>(row * cell) + half};
        *moves++ = At(t, center) >= 1;
      }
    }
  }
  return cells.repeat_interleave(cell, 1).repeat_interleave(cell, 2).slice(1, 0, height).slice(2, 0, width);
}

MotionEvidence MeasureMotion(const Clip& clip) {
  MotionEvidence evidence;
  const int64_t frames = clip.num_frames(), size = std::max<int64_t>(2, std::llround(kCellAt320 * clip.PixelScale()));
  const Cells cells = {size, (clip.height + size - 1) / size, (clip.width + size - 1) / size,
                       std::clamp<int64_t>(frames / 10, 4, 16)};
  evidence.cell = size;
  evidence.depth_uncertainty = DepthUncertainty(clip, cells);
  evidence.ratio = torch::full({frames, cells.rows, cells.columns}, NAN, torch::kFloat32);
  float* const ratio = evidence.ratio.data_ptr<float>();
  ParallelFor(frames, 1, [&](int64_t begin, int64_t end) {
    for (int64_t t = begin; t < end; ++t) {
      std::vector<double> known;
      float* const own = ratio + t * cells.rows * cells.columns;
      for (int64_t i = 0; i < cells.rows * cells.columns; ++i) {
        const Pixel center = cells.Center(i / cells.columns, i % cells.columns);
        own[i] = static_cast<float>(Deviation(clip, t, center, cells.reach, evidence.depth_uncertainty));
        if (std::isfinite(own[i])) known.push_back(own[i]);
      }
      if (known.empty()) continue;
      const auto threshold =
          static_cast<float>(std::max(kLeastDistance * clip.PixelScale(), kNoiseFactor * Percentile(known, 0.5)));
      for (int64_t i = 0; i < cells.rows * cells.columns; ++i) own[i] /= threshold;
    }
  });
  return evidence;
}

}  // namespace editnerf
