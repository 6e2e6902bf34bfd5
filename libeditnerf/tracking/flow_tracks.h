// Many pixels of what moves, each followed by checked flow for as long as it can be: what rigid parts are fitted to.
//
// Chained flow is long-lived where a surface stays in view: its error grows slowly, to some pixels over a hundred
// frames (part_alignment.h takes that away). At the edge of a part it is not: there dense flow drags the background
// along, and both directions agree on it. What tells is the image: the surroundings of a dragged pixel change within a
// few frames.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/motion_evidence.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {

struct FlowTrack {
  int64_t first = 0;         // frame of pixel[0]
  int64_t seed = 0;          // frame in which it was started
  std::vector<Pixel> pixel;  // consecutive frames
  bool chained = true;       // from flow, whose errors go on from frame to frame

  int64_t end() const { return first + static_cast<int64_t>(pixel.size()); }
  bool Covers(int64_t t) const { return t >= first && t < end(); }
  const Pixel& At(int64_t t) const { return pixel[static_cast<size_t>(t - first)]; }
};

// The pixel `start` of frame `seed` as far as checked flow leads to what looks the same; `start` alone where its
// surroundings change within a few frames.
FlowTrack FollowPixel(const Clip& clip, int64_t seed, const Pixel& start);

// Tracks of the pixels that move by the evidence and that no static point explains, started wherever no other track
// passes within two of the evidence's cells. Tracks of fewer than 6 frames are left out. range: scene units, of the
// static points that are tried. Throws Interrupted.
std::vector<FlowTrack> TrackMovingPixels(const Clip& clip, const MotionEvidence& motion, const DepthRange& range);

}  // namespace editnerf
