// Where parts that move are looked for first.
#pragma once

#include <cstddef>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {

// Tracks in the order of what standing still leaves unexplained around them. By numbers and lengths of tracks alone,
// places over which shades pass come before a small part that moves so fast that flow soon loses it.
class PartSeeds {
 public:
  // `tracks` must outlive it; those that are appended later are no seeds and count for nothing. range: scene units.
  PartSeeds(const Clip& clip, const std::vector<FlowTrack>& tracks, const DepthRange& range);

  // The track around which standing still explains least, or the number of tracks where none is left. `taken`: one flag
  // a track, those that belong to parts; they are no seeds and count for nothing.
  size_t Next(const std::vector<bool>& taken) const;

  // Never returns the track again; with `around`, nor those beside it.
  void Spend(size_t seed, bool around);

 private:
  bool Beside(size_t seed, size_t other) const;

  double reach_;  // pixels
  const std::vector<FlowTrack>& tracks_;
  std::vector<double> moves_;  // of those that there were at first
  std::vector<bool> spent_;
};

}  // namespace editnerf
