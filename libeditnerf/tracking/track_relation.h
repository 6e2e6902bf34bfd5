// What two or one of the 3-D tracks say about the parts they lie on. Tracks are [T, 3] in scene units, with a flag for
// every frame; frames without the flag are left out.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

struct PointTrack {
  std::vector<Vec3> position;  // T, scene units
  std::vector<bool> visible;   // T
};

struct TrackMotion {
  double range = 0;  // 95th percentile of the distance from the track's median position, scene units
  double noise = 0;  // standard deviation of one position, from second differences in time
  int64_t frames = 0;
};
TrackMotion MeasureTrackMotion(const PointTrack& track);

struct TrackRelation {
  double distance_spread = 0;  // 90th - 10th percentile of the distance between the two, scene units
  double synchrony = 0;        // correlation of their speeds, -1 to 1
  double parallelism = 0;      // correlation of their displacements as vectors, -1 to 1
  int64_t frames = 0;          // in which both are visible
};
TrackRelation RelateTracks(const PointTrack& a, const PointTrack& b);

// One rigid part: distance_spread < merge_distance * (smaller range) + noise, and synchrony or parallelism above 0.6.
// A constant distance alone is not enough: a part that moves across the line between the two changes it only to second
// order. Synchrony alone is not either: two parts may be moved at once. At least 5 common frames are required.
bool SameRigidPart(const PointTrack& a, const PointTrack& b, double merge_distance);

}  // namespace editnerf
