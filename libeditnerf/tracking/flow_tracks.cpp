#include "libeditnerf/tracking/flow_tracks.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/tracking/patches.h"
#include "libeditnerf/tracking/propagation.h"

namespace editnerf {
namespace {

constexpr double kLeastEvidence = 1.5;  // times the frame's threshold: away from the part's edge
constexpr int64_t kSeedInterval = 2;    // frames
constexpr size_t kShortest = 6;         // frames
constexpr size_t kLag = 3;              // frames over which surroundings are compared
constexpr double kCarriedSimilarity = 0.7, kUnturnedSimilarity = 0.8;
constexpr double kStillMiss = 2.0;    // pixels at 320 wide
constexpr double kStillShare = 0.85;  // of the frames
constexpr int kStillTrials = 60;

size_t At(int64_t i) { return static_cast<size_t>(i); }

// `start` and the pixels after it, in the order of `step`, until the flow fails its check or what it carries along
// changes its looks.
std::vector<Pixel> FollowOneWay(const Clip& clip, int64_t seed, const Pixel& start, int64_t step) {
  std::vector<Pixel> way = {start};
  std::deque<CarriedPatch> patches;  // of the last frames, oldest first
  for (int64_t t = seed;; t += step) {
    const FlowSample flow = clip.Step(t, step, way.back());
    const Pixel next = {way.back().u + flow.du, way.back().v + flow.dv};
    if (!flow.checked || !clip.Inside(next)) return way;
    patches.emplace_back(clip, t, way.back(), PatchRadius(clip));
    if (patches.size() > kLag) patches.pop_front();
    for (CarriedPatch& patch : patches) patch.Carry(t, step);
    if (patches.front().Similarity(t + step) < kCarriedSimilarity) return way;
    way.push_back(next);
  }
}

// For how many of the frames after the first the surroundings look the same where they lie, neither turned nor shrunk.
size_t LooksTheSame(const Clip& clip, int64_t seed, const std::vector<Pixel>& way, int64_t step) {
  for (size_t i = 1; i < way.size(); ++i) {
    const size_t lag = std::min(kLag, i);
    const int64_t now = seed + step * static_cast<int64_t>(i), before = now - step * static_cast<int64_t>(lag);
    if (PatchSimilarity(clip.gray[At(before)], way[i - lag], clip.gray[At(now)], way[i], PatchRadius(clip)) <
        kUnturnedSimilarity) {
      return i - 1;
    }
  }
  return way.size() - 1;
}

// Whether one static point explains most of the track. Parts rest at times, and tracks slip.
bool StandsStill(const Clip& clip, const FlowTrack& track, const DepthRange& range) {
  const double most = kStillMiss * clip.PixelScale();
  for (int i = 0; i < kStillTrials; ++i) {
    const double distance = 1 / (1 / range.far + (1 / range.near - 1 / range.far) * i / (kStillTrials - 1));
    const Vec3 point = clip.Lift(track.seed, track.At(track.seed), distance);
    size_t still = 0;
    for (int64_t t = track.first; t < track.end(); ++t) {
      const Projected at = Project(clip.cameras[At(t)], point);
      still += at.valid && Distance({at.u, at.v}, track.At(t)) < most;
    }
    if (static_cast<double>(still) > kStillShare * static_cast<double>(track.pixel.size())) return true;
  }
  return false;
}

// Which cells of which frames a track passes through.
class PassedCells {
 public:
  PassedCells(const Clip& clip, int64_t cell)
      : cell_(cell), rows_(clip.height / cell + 1), columns_(clip.width / cell + 1) {
    cells_.assign(At(clip.num_frames() * rows_ * columns_), false);
  }
  std::vector<bool>::reference operator()(int64_t t, const Pixel& p) {
    const int64_t row = static_cast<int64_t>(p.v) / cell_, column = static_cast<int64_t>(p.u) / cell_;
    return cells_[At((t * rows_ + row) * columns_ + column)];
  }

 private:
  int64_t cell_, rows_, columns_;
  std::vector<bool> cells_;
};

}  // namespace

FlowTrack FollowPixel(const Clip& clip, int64_t seed, const Pixel& start) {
  std::vector<Pixel> before = FollowOneWay(clip, seed, start, -1), after = FollowOneWay(clip, seed, start, 1);
  FlowTrack track;
  track.first = track.seed = seed;
  track.pixel = {start};
  // Background that flow drags along at the edge of a part changes around the seed already.
  if (LooksTheSame(clip, seed, before, -1) + LooksTheSame(clip, seed, after, 1) < kShortest) return track;
  track.first = seed - static_cast<int64_t>(before.size()) + 1;
  track.pixel.assign(before.rbegin(), before.rend());
  track.pixel.insert(track.pixel.end(), after.begin() + 1, after.end());
  return track;
}

std::vector<FlowTrack> TrackMovingPixels(const Clip& clip, const MotionEvidence& motion, const DepthRange& range) {
  std::vector<FlowTrack> tracks;
  PassedCells passed(clip, 2 * motion.cell);
  const int64_t cells = motion.ratio.size(1) * motion.ratio.size(2), columns = motion.ratio.size(2);
  const double half = static_cast<double>(motion.cell) / 2;
  for (int64_t t = 0; t < clip.num_frames(); t += kSeedInterval) {
    if (InterruptRequested()) Throw<Interrupted>("interrupted while moving pixels were followed");
    for (int64_t i = 0; i < cells; ++i) {
      const int64_t row = i / columns, column = i % columns;
      const Pixel start = {static_cast<double>(column * motion.cell) + half,
                           static_cast<double>(row * motion.cell) + half};
      if (!clip.Inside(start) || passed(t, start) || motion.At(t, start) < kLeastEvidence) continue;
      FlowTrack track = FollowPixel(clip, t, start);
      if (track.pixel.size() < kShortest) continue;
      for (int64_t s = track.first; s < track.end(); ++s) passed(s, track.At(s)) = true;
      tracks.push_back(std::move(track));
    }
  }
  std::vector<char> still(tracks.size());
  ParallelFor(static_cast<int64_t>(tracks.size()), 16, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) still[At(i)] = StandsStill(clip, tracks[At(i)], range);
  });
  std::vector<FlowTrack> moving;
  for (size_t i = 0; i < tracks.size(); ++i)
    if (!still[i]) moving.push_back(std::move(tracks[i]));
  return moving;
}

}  // namespace editnerf
