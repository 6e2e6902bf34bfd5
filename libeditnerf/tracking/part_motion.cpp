#include "libeditnerf/tracking/part_motion.h"

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/tracking/part_fit.h"

namespace editnerf {
namespace {

constexpr int kAlignments = 4, kSearches = 4,
              kAlignedIterations = 80;  // slow drift of all frames is what is solved for at last
constexpr double kAlignedPixels = 0.4;  // standard deviation at 320 wide
constexpr double kAlignedShape = 0.5;   // PartSolverOptions::shape, where the tracks tell it
constexpr double kRestPixels = 0.15;    // PartSolverOptions::rest_pixels; drift goes up to 0.1
constexpr double kSimplerCost = 1.3;    // times the mean miss, where freedom is needless; 2 where it is not
constexpr double kSimplerShare = 0.9;   // of the pixels that freer motion finds
// Where it drifts a part finds patches that one which is held does not, of stripes above all: 0.8 of them are found of
// those that are held rightly, half at most of others.
constexpr double kHeldShare = 0.75, kHopelessShare = 0.6;

PartSolverOptions AlignedOptions() {
  PartSolverOptions options;
  options.flow_pixels = kAlignedPixels;
  options.shape = kAlignedShape;
  options.iterations = kAlignedIterations;
  options.rest_pixels = kRestPixels;
  return options;
}

// One kind of motion, followed by itself.
struct Trial {
  std::vector<FlowTrack> tracks;
  PartFit fit;

  Trial(const Clip& clip, const std::vector<FlowTrack>& begin, const RigidPart& part, const DepthRange& range)
      : tracks(begin), fit(clip, tracks, AlignedOptions(), range) {
    fit.GoOn(part);
  }
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;

  bool Become(PartMotion motion) {
    // From turns that are known, if any.
    if (motion == PartMotion::kHinge && !fit.part().turns() && !fit.Become(PartMotion::kFree)) return false;
    return fit.part().motion == motion || fit.Become(motion);
  }

  bool AlignOnce() {
    if (InterruptRequested()) Throw<Interrupted>("interrupted while moving parts were aligned");
    if (!fit.Align(&tracks)) return false;
    fit.Settle();
    return true;
  }

  // Several times, as the part's own drift bends what patches are expected to look like, and from where they are looked
  // for. False where there is little left of the given number of pixels: it will not come back.
  bool Align(int64_t pixels) {
    for (int round = 0; round < kAlignments && AlignOnce(); ++round)
      if (static_cast<double>(fit.Observations()) < kHopelessShare * static_cast<double>(pixels)) return false;
    return true;
  }
};

}  // namespace

RigidPart FollowByLooks(const Clip& clip, const RigidPart& part, const DepthRange& range,
                        std::vector<FlowTrack>* tracks) {
  std::vector<PartMotion> kinds = {part.motion};
  if (part.motion != PartMotion::kHinge) {
    for (const PartMotion simpler : {PartMotion::kNoTurns, PartMotion::kRail, PartMotion::kHinge})
      if (simpler != part.motion) kinds.push_back(simpler);
  }
  Progress progress("alignment", static_cast<int64_t>(kinds.size()));
  std::vector<std::unique_ptr<Trial>> trials;  // that came out, the part's own kind first
  Trial *best = nullptr, *held = nullptr;
  for (const PartMotion kind : kinds) {
    progress.Update(static_cast<int64_t>(&kind - kinds.data()));
    // What holds a part is looked for where it has lost its drift.
    auto trial = trials.empty() || !IsHeld(kind)
                     ? std::make_unique<Trial>(clip, *tracks, part, range)
                     : std::make_unique<Trial>(clip, trials.front()->tracks, trials.front()->fit.part(), range);
    if (!trial->Become(kind) || !trial->Align(best ? best->fit.Observations() : 0)) continue;
    const PartFit::Follow now = trial->fit.Following();
    LogDebug("moving parts: {} {} points at {} pixels in {} frames, {:.3f} pixels off", NameOf(kind),
             trial->fit.part().points.size(), now.pixels, SeenFrames(trial->fit.part()).size(), now.miss);
    if (!best || PartFit::IsLike(now, best->fit.Following(), kSimplerCost, IsHeld(kind) ? kHeldShare : kSimplerShare)) {
      if (!IsHeld(kind) || !best) {
        best = trial.get();
      } else if (!held || now.pixels > held->fit.Following().pixels) {
        held = trial.get();
      }
    }
    trials.push_back(std::move(trial));
  }
  progress.Finish();
  if (held) best = held;
  if (!best) return part;
  for (int search = 0; search < kSearches && best->fit.FindLost(); ++search) best->AlignOnce();
  RigidPart followed = best->fit.Finished();
  *tracks = std::move(best->tracks);
  return followed;
}

}  // namespace editnerf
