#include "libeditnerf/tracking/stillness.h"

#include <algorithm>
#include <cmath>

namespace editnerf {
namespace {

constexpr double kUnit = 2.5;  // pixels at 320 wide

struct StillCost {
  Vec3 point;
  double cost = INFINITY;  // over all sightings
};

StillCost LeastCost(const Clip& clip, const std::vector<Sighting>& sightings, const Sighting& through,
                    const DepthRange& range) {
  constexpr int kTrials = 40;
  StillCost least;
  for (int i = 0; i < kTrials; ++i) {
    const double distance = 1 / (1 / range.far + (1 / range.near - 1 / range.far) * i / (kTrials - 1));
    const Vec3 held = clip.Lift(through.frame, through.pixel, distance);
    double cost = 0;
    for (const Sighting& sighting : sightings) cost += CostOf(clip, held, sighting);
    if (cost < least.cost) least = {held, cost};
  }
  return least;
}

}  // namespace

double CostOf(const Clip& clip, const Vec3& place, const Sighting& seen) {
  const Projected at = Project(clip.cameras[static_cast<size_t>(seen.frame)], place);
  if (!at.valid) return kMostCost;
  const double off = Distance({at.u, at.v}, seen.pixel) / (kUnit * clip.PixelScale());
  return std::min(off * off, kMostCost);
}

double CostOfStillness(const Clip& clip, const std::vector<Sighting>& sightings, const DepthRange& range) {
  return LeastCost(clip, sightings, sightings[sightings.size() / 2], range).cost /
         static_cast<double>(sightings.size());
}

std::vector<Sighting> SomeOf(const std::vector<Sighting>& sightings) {
  constexpr size_t kSamples = 16;
  std::vector<Sighting> some;
  const size_t stride = std::max<size_t>(1, sightings.size() / kSamples);
  for (size_t i = 0; i < sightings.size(); i += stride) some.push_back(sightings[i]);
  return some;
}

Vec3 StillestPoint(const Clip& clip, const std::vector<Sighting>& sightings, const DepthRange& range) {
  const std::vector<Sighting> some = SomeOf(sightings);
  return LeastCost(clip, some, some[some.size() / 2], range).point;
}

}  // namespace editnerf
