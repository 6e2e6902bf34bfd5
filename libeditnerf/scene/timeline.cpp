#include "libeditnerf/scene/timeline.h"

#include "libeditnerf/base/error.h"

namespace editnerf {

TimelinePosition LocateInTime(const Scene& scene, int64_t frame) {
  const SceneFrame& wanted = scene.frames.at(static_cast<size_t>(frame));
  if (wanted.warp_id < 0) Throw<DataError>("{}: frame {} has no place in time", scene.name, wanted.id);
  const auto warp_id = [&](int64_t row) {
    return scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(row)])].warp_id;
  };
  int64_t before = -1, after = -1;
  for (int64_t row = 0; row < static_cast<int64_t>(scene.train.size()); ++row) {
    const int64_t id = warp_id(row);
    if (id == wanted.warp_id) return {row, row, 0, true};
    if (id < wanted.warp_id && (before < 0 || id > warp_id(before))) before = row;
    if (id > wanted.warp_id && (after < 0 || id < warp_id(after))) after = row;
  }
  if (before < 0) return {after, after, 0, false};
  if (after < 0) return {before, before, 0, false};
  const double gap = static_cast<double>(warp_id(after) - warp_id(before));
  return {before, after, static_cast<double>(wanted.warp_id - warp_id(before)) / gap, false};
}

}  // namespace editnerf
