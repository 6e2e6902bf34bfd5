#include "libeditnerf/tracking/part_alignment.h"

#include <algorithm>

#include "libeditnerf/tracking/point_patch.h"

namespace editnerf {
namespace {

size_t At(int64_t t) { return static_cast<size_t>(t); }

}  // namespace

std::vector<FlowTrack> AlignPoint(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                                  const PartPoint& point) {
  const PointPatch patch(clip, tracks, part, point);
  if (!patch.HasCorner()) return {};
  const int64_t from = patch.frame();
  std::vector<Pixel> at(At(clip.num_frames()));
  std::vector<bool> found(at.size(), false);
  at[At(from)] = patch.center();
  found[At(from)] = true;
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
      at[At(t)] = there;
      found[At(t)] = true;
    }
  }
  std::vector<FlowTrack> runs;
  for (int64_t t = 0; t < clip.num_frames(); ++t) {
    if (!found[At(t)]) continue;
    if (t == 0 || !found[At(t - 1)]) runs.push_back({t, t, {}, false});
    runs.back().pixel.push_back(at[At(t)]);
  }
  std::stable_sort(runs.begin(), runs.end(),
                   [](const FlowTrack& a, const FlowTrack& b) { return a.pixel.size() > b.pixel.size(); });
  return runs;
}

}  // namespace editnerf
