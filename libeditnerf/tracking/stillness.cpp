#include "libeditnerf/tracking/stillness.h"

#include <algorithm>
#include <cmath>

namespace editnerf {
namespace {

constexpr double kUnit = 2.5;  // pixels at 320 wide

}  // namespace

double CostOf(const Clip& clip, const Vec3& place, const Sighting& seen) {
  const Projected at = Project(clip.cameras[static_cast<size_t>(seen.frame)], place);
  if (!at.valid) return kMostCost;
  const double off = Distance({at.u, at.v}, seen.pixel) / (kUnit * clip.PixelScale());
  return std::min(off * off, kMostCost);
}

double CostOfStillness(const Clip& clip, const std::vector<Sighting>& sightings, const DepthRange& range) {
  constexpr int kTrials = 40;
  const Sighting& middle = sightings[sightings.size() / 2];
  double least = INFINITY;
  for (int i = 0; i < kTrials; ++i) {
    const double distance = 1 / (1 / range.far + (1 / range.near - 1 / range.far) * i / (kTrials - 1));
    const Vec3 held = clip.Lift(middle.frame, middle.pixel, distance);
    double cost = 0;
    for (const Sighting& sighting : sightings) cost += CostOf(clip, held, sighting);
    least = std::min(least, cost);
  }
  return least / static_cast<double>(sightings.size());
}

}  // namespace editnerf
