#include "libeditnerf/tracking/part_seeds.h"

#include <algorithm>
#include <cstdint>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/tracking/stillness.h"

namespace editnerf {
namespace {

constexpr double kReach = 10;        // pixels at 320 wide around a seed in which tracks count
constexpr int64_t kMostFrames = 40;  // that a track counts for
constexpr size_t kStride = 2;        // every second track will do

// What is left of a track, over all its frames, where it should stand still.
double MovesBy(const Clip& clip, const FlowTrack& track, const DepthRange& range) {
  std::vector<Sighting> all;
  for (int64_t t = track.first; t < track.end(); ++t) all.push_back({t, track.At(t)});
  return static_cast<double>(std::min(kMostFrames, track.end() - track.first)) *
         CostOfStillness(clip, SomeOf(all), range);
}

}  // namespace

PartSeeds::PartSeeds(const Clip& clip, const std::vector<FlowTrack>& tracks, const DepthRange& range)
    : reach_(kReach * clip.PixelScale()), tracks_(tracks), moves_(tracks.size()), spent_(tracks.size(), false) {
  ParallelFor(static_cast<int64_t>(tracks.size()), 16, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
      moves_[i] = MovesBy(clip, tracks[i], range);
  });
}

size_t PartSeeds::Next(const std::vector<bool>& taken) const {
  size_t best = tracks_.size();
  double most = 0;
  for (size_t i = 0; i < moves_.size(); i += kStride) {
    if (taken[i] || spent_[i]) continue;
    double crowd = 0;
    for (size_t j = 0; j < moves_.size(); j += kStride)
      if (!taken[j] && Beside(i, j)) crowd += moves_[j];
    if (crowd > most) most = crowd, best = i;
  }
  return best;
}

void PartSeeds::Spend(size_t seed, bool around) {
  for (size_t i = 0; i < spent_.size(); ++i)
    if (i == seed || (around && Beside(seed, i))) spent_[i] = true;
}

bool PartSeeds::Beside(size_t seed, size_t other) const {
  const int64_t t = tracks_[seed].seed;
  return tracks_[other].Covers(t) && Distance(tracks_[other].At(t), tracks_[seed].At(t)) < reach_;
}

}  // namespace editnerf
