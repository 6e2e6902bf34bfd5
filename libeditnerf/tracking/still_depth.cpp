#include "libeditnerf/tracking/still_depth.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {
namespace {

constexpr int64_t kSpacingAt320 = 6;                          // pixels between the points that are looked for
constexpr int64_t kLeastReach = 6, kMostReach = 16;           // frames to each side of the longest window
constexpr size_t kShortestChain = 3, kShortRest = 4;          // frames in the longest window, and in the others
constexpr double kMostMiss = 0.75, kMostMissAtRest = 0.5;     // pixels at 320 wide, likewise: little time shows little
constexpr double kMostPrecise = 0.005, kLeastPrecise = 0.15;  // shares of the distance
constexpr double kMostSeenThrough = 0.2;                      // of the frames that see the place

// Frames around one, in which a point must stand still. Parts that move rest at times.
struct Window {
  int64_t before, after;
  size_t least;      // frames at least
  double most_miss;  // pixels at 320 wide
};

// One row of distances and precisions for every frame; NaN where nothing is known.
class StillMap {
 public:
  StillMap(const Clip& clip, double near, double far)
      : clip_(clip),
        spacing_(std::max<int64_t>(2, std::llround(kSpacingAt320 * clip.PixelScale()))),
        rows_(clip.height / spacing_),
        columns_(clip.width / spacing_) {
    const int64_t frames = clip.num_frames();
    reach_ = std::clamp(frames / 10, kLeastReach, kMostReach);
    windows_ = {{reach_, reach_, kShortestChain, kMostMiss},  {reach_ / 2, reach_ / 2, kShortRest, kMostMissAtRest},
                {0, reach_, kShortRest, kMostMissAtRest},     {reach_, 0, kShortRest, kMostMissAtRest},
                {0, reach_ / 2, kShortRest, kMostMissAtRest}, {reach_ / 2, 0, kShortRest, kMostMissAtRest}};
    const auto cells = static_cast<size_t>(frames * rows_ * columns_);
    distance_.assign(cells, NAN);
    precision_.assign(cells, NAN);
    window_.assign(cells, nullptr);
    Progress progress("static depth", static_cast<double>(frames));
    std::mutex mutex;
    int64_t done = 0;
    ParallelFor(frames, 1, [&](int64_t begin, int64_t end) {
      for (int64_t t = begin; t < end; ++t) {
        if (InterruptRequested()) Throw<Interrupted>("interrupted while the static depth was triangulated");
        for (int64_t i = 0; i < rows_ * columns_; ++i) Find(t, i, {near, far});
        const std::lock_guard<std::mutex> lock(mutex);
        progress.Update(static_cast<double>(++done));
      }
    });
    progress.Finish();
  }

  int64_t count() const { return rows_ * columns_; }
  Pixel Center(int64_t cell) const {
    return {(static_cast<double>(cell % columns_) + 0.5) * static_cast<double>(spacing_),
            (static_cast<double>(cell / columns_) + 0.5) * static_cast<double>(spacing_)};
  }
  double Distance(int64_t t, int64_t cell) const { return distance_[Index(t, cell)]; }
  double Precision(int64_t t, int64_t cell) const { return precision_[Index(t, cell)]; }

  // Whether the frames that see the place agree that there is a surface.
  bool Agreed(int64_t t, int64_t cell) const {
    const Vec3 point = clip_.Lift(t, Center(cell), Distance(t, cell));
    const Window& window = *window_[Index(t, cell)];
    const int64_t first = std::max<int64_t>(t - window.before, 0);
    const int64_t last = std::min(t + window.after, clip_.num_frames() - 1);
    int64_t agreed = 0, through = 0;
    for (int64_t s = first; s <= last; ++s) {
      if (s == t) continue;
      const Projected projected = Project(clip_.cameras[static_cast<size_t>(s)], point);
      const Pixel at = {projected.u, projected.v};
      if (!projected.valid || !clip_.Inside(at)) continue;
      const int64_t row = static_cast<int64_t>(at.v) / spacing_, column = static_cast<int64_t>(at.u) / spacing_;
      if (row >= rows_ || column >= columns_) continue;
      const int64_t there = row * columns_ + column;
      const double seen = Distance(s, there), expected = Norm(point - clip_.cameras[static_cast<size_t>(s)].position);
      if (std::isnan(seen)) continue;
      const double slack = 2 * (Precision(s, there) + Precision(t, cell)) + 0.03;
      if (seen > expected * (1 + slack)) {
        ++through;
      } else if (seen > expected / (1 + slack)) {
        ++agreed;
      }
    }
    return static_cast<double>(through) <= kMostSeenThrough * static_cast<double>(agreed + through);
  }

 private:
  size_t Index(int64_t t, int64_t cell) const { return static_cast<size_t>(t * rows_ * columns_ + cell); }

  void Find(int64_t t, int64_t cell, const DepthRange& range) {
    const Pixel p = Center(cell);
    const Texture texture = TextureAround(clip_.gray[static_cast<size_t>(t)], p);
    if (!texture.Enough()) return;
    const Chain chain = FollowFlow(clip_, t, p, reach_);
    for (const Window& window : windows_) {
      const Chain part = Within(chain, t, window);
      if (part.frame.size() < window.least) continue;
      const StillPoint still = FindStillPoint(clip_, t, p, range, part, texture);
      if (!(still.miss < window.most_miss * clip_.PixelScale()) || !(still.precision <= kLeastPrecise)) continue;
      distance_[Index(t, cell)] = still.distance;
      precision_[Index(t, cell)] = still.precision;
      window_[Index(t, cell)] = &window;
      return;
    }
  }

  static Chain Within(const Chain& chain, int64_t t, const Window& window) {
    Chain part;
    for (size_t i = 0; i < chain.frame.size(); ++i) {
      if (chain.frame[i] < t - window.before || chain.frame[i] > t + window.after) continue;
      part.frame.push_back(chain.frame[i]);
      part.pixel.push_back(chain.pixel[i]);
    }
    return part;
  }

  const Clip& clip_;
  int64_t spacing_, rows_, columns_, reach_ = 0;
  std::vector<Window> windows_;
  std::vector<double> distance_, precision_;
  std::vector<const Window*> window_;
};

}  // namespace

DepthTargets TriangulateStillDepth(const Clip& clip, double near, double far) {
  const StillMap map(clip, near, far);
  std::vector<int64_t> frame, pixel;
  std::vector<float> distance, tolerance;
  for (int64_t t = 0; t < clip.num_frames(); ++t) {
    for (int64_t cell = 0; cell < map.count(); ++cell) {
      if (std::isnan(map.Distance(t, cell)) || !map.Agreed(t, cell)) continue;
      const Pixel center = map.Center(cell);
      frame.push_back(t);
      pixel.push_back(static_cast<int64_t>(center.u));
      pixel.push_back(static_cast<int64_t>(center.v));
      distance.push_back(static_cast<float>(map.Distance(t, cell)));
      tolerance.push_back(static_cast<float>(std::max(kMostPrecise, 0.5 * map.Precision(t, cell))));
    }
  }
  const auto count = static_cast<int64_t>(distance.size());
  DepthTargets targets;
  targets.frame = torch::tensor(frame, torch::kInt64);
  targets.pixel = torch::tensor(pixel, torch::kInt64).view({count, 2});
  targets.distance = torch::tensor(distance, torch::kFloat32);
  targets.tolerance = torch::tensor(tolerance, torch::kFloat32);
  targets.key_point = torch::full({count}, kStandsStill, torch::kInt64);
  return targets;
}

torch::Tensor PutKnownDepth(const torch::Tensor& depth, const DepthTargets& targets, int64_t reach) {
  CheckShape(depth, {kAny, kAny, kAny}, "depth maps");
  torch::Tensor result = depth.to(torch::kFloat32).contiguous().clone();
  const int64_t height = depth.size(1), width = depth.size(2);
  float* const distances = result.data_ptr<float>();
  if (targets.size() == 0) return result;
  const auto frame = targets.frame.accessor<int64_t, 1>();
  const auto pixel = targets.pixel.accessor<int64_t, 2>();
  const auto distance = targets.distance.accessor<float, 1>();
  for (int64_t i = 0; i < targets.size(); ++i) {
    const int64_t t = frame[i], u = pixel[i][0], v = pixel[i][1];
    for (int64_t y = std::max<int64_t>(v - reach, 0); y <= std::min(v + reach, height - 1); ++y)
      for (int64_t x = std::max<int64_t>(u - reach, 0); x <= std::min(u + reach, width - 1); ++x)
        distances[(t * height + y) * width + x] = distance[i];
  }
  return result;
}

}  // namespace editnerf
