#include "libeditnerf/tracking/part_gain.h"

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"

namespace editnerf {
namespace {

constexpr double kNear = 4;              // cost of what lies where the part is
constexpr double kFewestInFrame = 4;     // pixels of a part that say where it is in a frame
constexpr size_t kFewestOfResting = 12;  // points of a part that rests nearly all the time
constexpr size_t kShareOfResting = 3;    // one in so many frames in which it has to be seen
constexpr double kMostAway = 0.85;       // share of its pixels that are once far from where they would stand still,
constexpr double kOftenAway = 0.5;       // and in a twentieth of the frames; slips reach 0.65, or 0.9 once and 0.3

size_t At(int64_t i) { return static_cast<size_t>(i); }

struct Seen {
  int64_t frame;
  double still, moving;  // costs of a static point and of the part's
};

std::vector<Seen> SeenOf(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                         const PartPoint& point, const DepthRange& range) {
  std::vector<Seen> seen;
  for (const size_t i : point.tracks) {
    std::vector<Sighting> sightings;
    for (int64_t t = tracks[i].first; t < tracks[i].end(); ++t)
      if (part.seen[At(t)]) sightings.push_back({t, tracks[i].At(t)});
    if (sightings.empty()) continue;
    const Vec3 still = StillestPoint(clip, sightings, range);
    for (const Sighting& sighting : sightings) {
      const Vec3 place = part.Place(sighting.frame, ToVec3(point.position));
      seen.push_back({sighting.frame, CostOf(clip, still, sighting), CostOf(clip, place, sighting)});
    }
  }
  return seen;
}

// Per frame in which enough is seen: the mean gain, and the share of pixels that are as far as can be from where a
// static point would be, and near to where the part is.
struct InFrames {
  std::vector<double> gain, away;
};

// A few points in a few frames are anything.
bool GoesAway(const InFrames& frames, const RigidPart& part) {
  return part.points.size() >= kFewestOfResting && kShareOfResting * SeenFrames(part).size() >= part.seen.size() &&
         Percentile(frames.away, 1) >= kMostAway && Percentile(frames.away, 0.95) >= kOftenAway;
}

}  // namespace

PartGain GainOverStillness(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                           const DepthRange& range) {
  std::vector<std::vector<Seen>> seen(part.points.size());
  ParallelFor(static_cast<int64_t>(part.points.size()), 4, [&](int64_t begin, int64_t end) {
    for (int64_t k = begin; k < end; ++k) seen[At(k)] = SeenOf(clip, tracks, part, part.points[At(k)], range);
  });
  struct Frame {
    double gain = 0, away = 0, count = 0;
  };
  std::vector<Frame> frames(clip.cameras.size());
  for (const std::vector<Seen>& of_point : seen) {
    for (const Seen& one : of_point) {
      Frame& frame = frames[At(one.frame)];
      frame.gain += one.still - one.moving;
      frame.away += one.still >= kMostCost && one.moving < kNear ? 1 : 0;
      frame.count += 1;
    }
  }
  PartGain gain;
  InFrames means;
  double count = 0;
  for (const Frame& frame : frames) {
    gain.all += frame.gain;
    count += frame.count;
    if (frame.count < kFewestInFrame) continue;
    means.gain.push_back(frame.gain / frame.count);
    means.away.push_back(frame.away / frame.count);
  }
  gain.moving = count > 0 ? gain.all / count : 0;
  if (gain.moving < kLeastGain && !means.away.empty() && GoesAway(means, part))
    gain.moving = Percentile(means.gain, 0.9);
  return gain;
}

}  // namespace editnerf
