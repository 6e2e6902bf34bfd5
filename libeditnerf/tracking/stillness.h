// How badly static points explain where something was seen, as a cost that parts and tracks are compared by.
#pragma once

#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {

struct Sighting {
  int64_t frame = 0;
  Pixel pixel;
};

// The squared distance between a scene point's pixel and where it was seen, in units of 2.5 pixels at 320 wide, at most
// kMostCost.
constexpr double kMostCost = 16;
double CostOf(const Clip& clip, const Vec3& place, const Sighting& seen);

// Every so many of them, 16 to 31 where there are as many: what tells how far all have moved.
std::vector<Sighting> SomeOf(const std::vector<Sighting>& sightings);

// The static point on the ray of the sighting in the middle, within the range (scene units), that costs least over some
// of the sightings, at least one.
Vec3 StillestPoint(const Clip& clip, const std::vector<Sighting>& sightings, const DepthRange& range);

// The mean over the sightings for the static point on that ray that costs least over all of them.
double CostOfStillness(const Clip& clip, const std::vector<Sighting>& sightings, const DepthRange& range);

// From this cost on something moves. What is static but badly followed costs up to 3.9 on the synthetic scenes.
constexpr double kLeastGain = 4;

}  // namespace editnerf
