#include "libeditnerf/tracking/part_alignment.h"

#include <algorithm>

#include "libeditnerf/tracking/point_patch.h"

namespace editnerf {
namespace {

constexpr size_t kLeastToFit = 6, kFitted = 12;  // frames

size_t At(int64_t t) { return static_cast<size_t>(t); }

// Where the patch is found, from its own frame both ways; in time order.
std::vector<Sighting> FindAlong(const Clip& clip, const RigidPart& part, const PointPatch& patch) {
  const int64_t from = patch.frame();
  std::vector<Sighting> seen = {{from, patch.center()}};
  for (const int64_t step : {-1, 1}) {
    const Projected start = Project(clip.cameras[At(from)], part.Place(from, patch.position()));
    Pixel off = {patch.center().u - start.u, patch.center().v - start.v};  // of the image from the part, as last found
    for (int64_t t = from + step; t >= 0 && t < clip.num_frames(); t += step) {
      const Projected expected = Project(clip.cameras[At(t)], part.Place(t, patch.position()));
      const PatchWarp warp = patch.WarpTo(clip, part, t);
      if (!part.seen[At(t)] || !expected.valid || !PointPatch::IsComparable(warp)) continue;
      Pixel there = {expected.u + off.u, expected.v + off.v};
      if (!patch.Find(clip, t, warp, &there)) continue;
      off = {there.u - expected.u, there.v - expected.v};
      seen.push_back({t, there});
    }
  }
  std::sort(seen.begin(), seen.end(), [](const Sighting& a, const Sighting& b) { return a.frame < b.frame; });
  return seen;
}

}  // namespace

std::vector<FlowTrack> AlignPoint(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                                  const PartPoint& point) {
  PointPatch patch(clip, tracks, part, point);
  if (!patch.HasCorner()) return {};
  std::vector<Sighting> seen = FindAlong(clip, part, patch);
  if (seen.size() >= kLeastToFit) {
    std::vector<Sighting> some;
    for (size_t i = 0; i < kFitted; ++i) some.push_back(seen[i * (seen.size() - 1) / (kFitted - 1)]);
    patch.FitNormal(clip, part, some);
    seen = FindAlong(clip, part, patch);
  }
  std::vector<FlowTrack> runs;
  for (const Sighting& one : seen) {
    if (runs.empty() || runs.back().end() != one.frame) runs.push_back({one.frame, one.frame, {}, false});
    runs.back().pixel.push_back(one.pixel);
  }
  std::stable_sort(runs.begin(), runs.end(),
                   [](const FlowTrack& a, const FlowTrack& b) { return a.pixel.size() > b.pixel.size(); });
  return runs;
}

}  // namespace editnerf
