#include "libeditnerf/tracking/part_held.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libeditnerf/tracking/part_hinge.h"
#include "libeditnerf/tracking/part_scale.h"
#include "libeditnerf/tracking/part_slide.h"

namespace editnerf {
namespace {

constexpr double kDistances[] = {0.8, 1, 1.25};  // times that of the part

}  // namespace

std::optional<double> SolveHeld(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, RigidPart* part) {
  const std::vector<int64_t> frames = SeenFrames(*part);
  if (part->motion == PartMotion::kHinge) {
    std::optional<Hinge> hinge = NearestHinge(*part, frames);
    return hinge ? SolveHinge(clip, tracks, options, frames, &*hinge, part) : std::nullopt;
  }
  std::optional<Slide> slide = NearestSlide(*part, frames, FreedomOf(part->motion));
  return slide ? SolveSlide(clip, tracks, options, frames, &*slide, part) : std::nullopt;
}

// Free motion leaves the distance open, so that what holds it stands still at one distance only: several are begun
// from, each solved twice, as the first time points are held to a centre at that distance.
std::optional<RigidPart> HeldBy(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, const RigidPart& part, PartMotion motion) {
  std::optional<RigidPart> best;
  double least = INFINITY;
  for (const double s : kDistances) {
    RigidPart trial = ScaledFromCameras(clip, part, s);
    trial.motion = motion;
    if (!SolveHeld(clip, tracks, options, &trial)) continue;
    const std::optional<double> cost = SolveHeld(clip, tracks, options, &trial);
    if (!cost || *cost >= least) continue;
    least = *cost;
    best = std::move(trial);
  }
  return best;
}

void FillUnseen(RigidPart* part) {
  const std::vector<int64_t> seen = SeenFrames(*part);
  if (seen.empty()) return;
  for (int64_t t = 0; t < static_cast<int64_t>(part->pose.size()); ++t) {
    const auto nearest = std::min_element(seen.begin(), seen.end(),
                                          [t](int64_t a, int64_t b) { return std::abs(a - t) < std::abs(b - t); });
    part->pose[static_cast<size_t>(t)] = part->pose[static_cast<size_t>(*nearest)];
  }
  if (part->motion == PartMotion::kHinge) {
    FillAngles(part);
  } else if (IsHeld(part->motion)) {
    FillPlaces(part);
  }
}

}  // namespace editnerf
