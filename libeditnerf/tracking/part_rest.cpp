#include "libeditnerf/tracking/part_rest.h"

#include <algorithm>
#include <cmath>

namespace editnerf {
namespace {

constexpr size_t kAround = 3;      // frames before and after a step
constexpr double kInDepth = 0.25;  // what a way to or from the camera counts for
constexpr double kAlone = 2;       // times the rest's pixels that the step itself may go

double WayOf(const Clip& clip, const RigidPart& part, int64_t a, int64_t b) {
  const Vec3 from = part.Place(a, part.center), way = part.Place(b, part.center) - from;
  const Vec3 axis = Normalized(from - clip.cameras[static_cast<size_t>(a)].position);
  const double along = Dot(way, axis);
  return std::hypot(Norm(way - along * axis), kInDepth * along);
}

}  // namespace

bool RestsAt(const Clip& clip, const RigidPart& part, const PartSolverOptions& options,
             const std::vector<int64_t>& frames, size_t i) {
  if (options.rest_pixels == 0) return false;
  const size_t first = i > kAround ? i - kAround : 0, last = std::min(frames.size() - 1, i + 1 + kAround);
  const double most = options.rest_pixels * PixelAt(clip, DistanceOf(clip, part));
  return WayOf(clip, part, frames[first], frames[last]) < most * static_cast<double>(frames[last] - frames[first]) &&
         WayOf(clip, part, frames[i], frames[i + 1]) < kAlone * most;
}

}  // namespace editnerf
