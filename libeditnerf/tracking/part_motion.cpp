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
// On a plane, beside the same motion without one: 0.96 to 1.1 of the pixels at 0.95 to 1.05 times the miss where it is
// right, 0.85 and 0.92 at 1.2 and 2.0 times where it is not.
constexpr double kPlaneCost = 1.1, kPlaneShare = 0.94;

PartSolverOptions AlignedOptions() {
  PartSolverOptions options;
  options.flow_pixels = kAlignedPixels;
  options.shape = kAlignedShape;
  options.iterations = kAlignedIterations;
  options.rest_pixels = kRestPixels;
  options.hold_scale = true;
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

// The simplest kind of motion that explains the part about as well as freer ones do.
class Choice {
 public:
  // In the order of kinds below.
  void Consider(Trial* trial) {
    const PartMotion kind = trial->fit.part().motion;
    const PartFit::Follow now = trial->fit.Following();
    if (kind == PartMotion::kNoTurns) without_turns_ = now;
    if (!best_) {
      best_ = trial;
    } else if (!IsHeld(kind)) {
      if (PartFit::IsLike(now, best_->fit.Following(), kSimplerCost, kSimplerShare)) best_ = trial;
    } else if (PartFit::IsLike(now, best_->fit.Following(), kSimplerCost, kHeldShare) && MayBe(kind, now) &&
               (!held_ || IsBetter(*trial, *held_))) {
      held_ = trial;
    }
  }

  Trial* trial() const { return held_ ? held_ : best_; }
  int64_t Observations() const { return best_ ? best_->fit.Observations() : 0; }

 private:
  // Wherever a part is seen it can be put on a plane, nearer or farther than it is. That shows in its size alone.
  bool MayBe(PartMotion kind, const PartFit::Follow& now) const {
    return kind != PartMotion::kPlane || PartFit::IsLike(now, without_turns_, kPlaneCost, kPlaneShare);
  }

  // Of two that hold the part. A line lies in a plane, and what goes along it is found a little more often there.
  static bool IsBetter(const Trial& trial, const Trial& other) {
    const PartFit::Follow now = trial.fit.Following(), then = other.fit.Following();
    const bool simpler = trial.fit.part().motion == PartMotion::kRail && other.fit.part().motion == PartMotion::kPlane;
    return simpler ? PartFit::IsLike(now, then, kSimplerCost, kHeldShare) : now.pixels > then.pixels;
  }

  Trial *best_ = nullptr, *held_ = nullptr;
  PartFit::Follow without_turns_;
};

std::vector<PartMotion> KindsFor(PartMotion motion) {
  // Far from its axis what is on a hinge moves as on a rail.
  if (motion == PartMotion::kHinge) return {PartMotion::kHinge, PartMotion::kRail};
  std::vector<PartMotion> kinds = {motion};
  for (const PartMotion simpler : {PartMotion::kNoTurns, PartMotion::kPlane, PartMotion::kRail, PartMotion::kHinge})
    if (simpler != motion) kinds.push_back(simpler);
  return kinds;
}

}  // namespace

RigidPart FollowByLooks(const Clip& clip, const RigidPart& part, const DepthRange& range,
                        std::vector<FlowTrack>* tracks) {
  const std::vector<PartMotion> kinds = KindsFor(part.motion);
  Progress progress("alignment", static_cast<int64_t>(kinds.size()));
  std::vector<std::unique_ptr<Trial>> trials;  // that came out, the part's own kind first
  Choice choice;
  for (const PartMotion kind : kinds) {
    progress.Update(static_cast<int64_t>(&kind - kinds.data()));
    // What holds a part is looked for where it has lost its drift.
    auto trial = trials.empty() || !IsHeld(kind)
                     ? std::make_unique<Trial>(clip, *tracks, part, range)
                     : std::make_unique<Trial>(clip, trials.front()->tracks, trials.front()->fit.part(), range);
    if (!trial->Become(kind) || !trial->Align(choice.Observations())) continue;
    const PartFit::Follow now = trial->fit.Following();
    LogDebug("moving parts: {} {} points at {} pixels in {} frames, {:.3f} pixels off", NameOf(kind),
             trial->fit.part().points.size(), now.pixels, SeenFrames(trial->fit.part()).size(), now.miss);
    choice.Consider(trial.get());
    trials.push_back(std::move(trial));
  }
  progress.Finish();
  Trial* best = choice.trial();
  if (!best) return part;
  for (int search = 0; search < kSearches && best->fit.FindLost(); ++search) best->AlignOnce();
  RigidPart followed = best->fit.Finished();
  *tracks = std::move(best->tracks);
  return followed;
}

}  // namespace editnerf
