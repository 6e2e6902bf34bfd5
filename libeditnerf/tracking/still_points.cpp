#include "libeditnerf/tracking/still_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace editnerf {
namespace {

constexpr int64_t kTextureRadius = 3;
constexpr int kTrials = 24;  // distances in each round of the search

class Search {
 public:
  Search(const Clip& clip, int64_t t, const Pixel& p, const Chain& chain, const Texture& texture)
      : clip_(clip), t_(t), p_(p), chain_(chain), texture_(texture) {}

  // Largest miss over the chain's frames, given up on as soon as it exceeds `limit`.
  double Miss(double distance, double limit = std::numeric_limits<double>::infinity()) const {
    const Vec3 point = clip_.Lift(t_, p_, distance);
    const double strongest = texture_.Strongest(), most = limit * limit * strongest;
    double largest = 0;
    for (size_t i = 0; i < chain_.frame.size() && largest <= most; ++i) {
      const Projected still = Project(clip_.cameras[static_cast<size_t>(chain_.frame[i])], point);
      if (!still.valid) return NAN;
      const double du = chain_.pixel[i].u - still.u, dv = chain_.pixel[i].v - still.v;
      largest = std::max(largest, texture_.xx * du * du + 2 * texture_.xy * du * dv + texture_.yy * dv * dv);
    }
    return std::sqrt(largest / strongest);
  }

  // Two rounds over evenly spaced inverse distances: coarse, then around the best.
  StillPoint Best(const DepthRange& range) const {
    StillPoint best;
    double low = 1 / range.far, high = 1 / range.near;
    for (int round = 0; round < 2; ++round) {
      const double step = (high - low) / (kTrials - 1);
      for (int i = 0; i < kTrials; ++i) {
        const double distance = 1 / (low + i * step);
        const double miss = std::isnan(best.miss) ? Miss(distance) : Miss(distance, best.miss);
        if (std::isnan(best.miss) || miss < best.miss) best = {miss, distance, NAN};
      }
      if (std::isnan(best.miss)) return best;
      low = std::max(1 / best.distance - step, 1 / range.far);
      high = std::min(1 / best.distance + step, 1 / range.near);
    }
    return best;
  }

  double Precision(const StillPoint& best) const {
    const double limit = best.miss + clip_.PixelScale();
    for (const double share : {0.01, 0.02, 0.04, 0.07, 0.1, 0.15, 0.25, kLoosest}) {
      const double nearer = Miss(best.distance / (1 + share), limit),
                   farther = Miss(best.distance * (1 + share), limit);
      if (!(nearer < limit) && !(farther < limit)) return share;
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  const Clip& clip_;
  int64_t t_;
  const Pixel& p_;
  const Chain& chain_;
  const Texture& texture_;
};

}  // namespace

double Texture::Strongest() const { return 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy); }

Texture TextureAround(const torch::Tensor& gray, const Pixel& p) {
  const int64_t height = gray.size(0), width = gray.size(1);
  const float* values = gray.data_ptr<float>();
  const auto column = static_cast<int64_t>(p.u), row = static_cast<int64_t>(p.v);
  Texture texture;
  double count = 0;
  for (int64_t r = std::max<int64_t>(row - kTextureRadius, 1); r <= std::min(row + kTextureRadius, height - 2); ++r) {
    for (int64_t c = std::max<int64_t>(column - kTextureRadius, 1); c <= std::min(column + kTextureRadius, width - 2);
         ++c, ++count) {
      const float* at = values + r * width + c;
      const double dx = 0.5 * (at[1] - at[-1]), dy = 0.5 * (at[width] - at[-width]);
      texture.xx += dx * dx, texture.xy += dx * dy, texture.yy += dy * dy;
    }
  }
  if (count > 0) texture.xx /= count, texture.xy /= count, texture.yy /= count;
  return texture;
}

Chain FollowFlow(const Clip& clip, int64_t t, const Pixel& p, int64_t reach) {
  Chain chain;
  for (const int64_t step : {int64_t{1}, int64_t{-1}}) {
    Pixel here = p;
    for (int64_t s = t; std::abs(s - t) < reach; s += step) {
      const FlowSample flow = clip.Step(s, step, here);
      if (!flow.checked) break;
      here = {here.u + flow.du, here.v + flow.dv};
      if (!clip.Inside(here)) break;
      chain.frame.push_back(s + step);
      chain.pixel.push_back(here);
    }
  }
  std::vector<size_t> order(chain.frame.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return std::abs(chain.frame[a] - t) > std::abs(chain.frame[b] - t); });
  Chain sorted;
  for (const size_t i : order) {
    sorted.frame.push_back(chain.frame[i]);
    sorted.pixel.push_back(chain.pixel[i]);
  }
  return sorted;
}

StillPoint FindStillPoint(const Clip& clip, int64_t t, const Pixel& p, const DepthRange& range, const Chain& chain,
                          const Texture& texture) {
  const Search search(clip, t, p, chain, texture);
  StillPoint best = search.Best(range);
  if (!std::isnan(best.miss)) best.precision = search.Precision(best);
  return best;
}

}  // namespace editnerf
