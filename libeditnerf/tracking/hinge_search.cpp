#include "libeditnerf/tracking/hinge_search.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/point_patch.h"

namespace editnerf {
namespace {

constexpr double kStep = 0.025;      // radians: what lies farthest from the hinge goes two pixels
constexpr double kBeyond = 1;        // radians, outside of the angles that are known
constexpr size_t kMostPatches = 80;  // that are looked for
constexpr int64_t kLeastFound = 6;   // that say where it is,
constexpr int64_t kLeastKept = 3;    // and that leave it where tracks have it, as it is seen along its surface, say
constexpr double kNear = 0.35, kNearCounts = 1.4;  // radians from the frame beside it, and by how much more it counts
constexpr double kLostShare = 0.5;                 // of the points that are usually found

size_t At(int64_t t) { return static_cast<size_t>(t); }

std::vector<PointPatch> SomePatches(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part) {
  std::vector<PointPatch> patches;
  for (const PartPoint& point : part.points) {
    PointPatch patch(clip, tracks, part, point);
    if (patch.HasCorner()) patches.push_back(std::move(patch));
  }
  // From all over the part, whatever order its points have.
  const size_t stride = std::max<size_t>(1, patches.size() / kMostPatches);
  std::vector<PointPatch> some;
  for (size_t i = 0; i < patches.size(); i += stride) some.push_back(std::move(patches[i]));
  return some;
}

int64_t CountFound(const Clip& clip, const std::vector<PointPatch>& patches, const RigidPart& part, int64_t t) {
  int64_t found = 0;
  for (const PointPatch& patch : patches) {
    if (patch.frame() == t) continue;
    const Projected expected = Project(clip.cameras[At(t)], part.Place(t, patch.position()));
    const PatchWarp warp = patch.WarpTo(clip, part, t);
    if (!expected.valid || warp.Determinant() <= 0 || !PointPatch::IsComparable(warp)) continue;
    Pixel there = {expected.u, expected.v};
    found += patch.Find(clip, t, warp, &there) ? 1 : 0;
  }
  return found;
}

struct Sight {
  double angle = 0;
  int64_t found = 0;
};

// One part, its hinge, and what is found of it at which angle.
class HingeSearch {
 public:
  HingeSearch(const Clip& clip, const std::vector<FlowTrack>& tracks, RigidPart* part)
      : clip_(clip),
        tracks_(tracks),
        part_(part),
        patches_(SomePatches(clip, tracks, *part)),
        seen_(SeenFrames(*part)) {}

  int64_t Run() {
    if (!FindKnown()) return 0;
    std::vector<Sight> anywhere(lost_.size());
    ParallelFor(static_cast<int64_t>(lost_.size()), 1, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) anywhere[At(i)] = Best(lost_[At(i)], low_, high_);
    });
    // From the frames that are known outwards.
    int64_t moved = 0;
    std::vector<bool> settled(part_->seen.size(), false);
    for (const int64_t t : known_) settled[At(t)] = true;
    for (size_t left = lost_.size(); left > 0; --left) {
      size_t next = 0;
      int64_t nearest = clip_.num_frames(), beside = 0;
      for (size_t i = 0; i < lost_.size(); ++i) {
        if (settled[At(lost_[i])]) continue;
        for (int64_t t = 0; t < clip_.num_frames(); ++t) {
          if (!settled[At(t)] || std::abs(t - lost_[i]) >= nearest) continue;
          nearest = std::abs(t - lost_[i]), next = i, beside = t;
        }
      }
      moved += Place(lost_[next], hinge_->angle[At(beside)], anywhere[next]) ? 1 : 0;
      settled[At(lost_[next])] = true;
    }
    LogDebug("moving parts: hardly or not seen on its hinge in {} of {} frames, found in {} of them", lost_.size(),
             clip_.num_frames(), moved);
    return moved;
  }

 private:
  // Tells the frames that are known from those that are not; false where there is nothing to look for.
  bool FindKnown() {
    found_.resize(part_->seen.size());
    ParallelFor(static_cast<int64_t>(seen_.size()), 1, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i)
        found_[At(seen_[At(i)])] = CountFound(clip_, patches_, *part_, seen_[At(i)]);
    });
    std::vector<double> counts;
    for (const int64_t t : seen_) counts.push_back(static_cast<double>(found_[At(t)]));
    if (counts.empty()) return false;
    least_ = kLostShare * Percentile(counts, 0.5);
    for (const int64_t t : seen_)
      if (static_cast<double>(found_[At(t)]) >= least_) known_.push_back(t);
    for (int64_t t = 0; t < clip_.num_frames(); ++t)
      if (static_cast<double>(found_[At(t)]) < least_) lost_.push_back(t);
    // The reference frame has its pose by definition, and so it has to be one of those that are known.
    if (!known_.empty() && std::find(known_.begin(), known_.end(), part_->reference) == known_.end()) {
      *part_ = ReferredTo(*part_, *std::max_element(known_.begin(), known_.end(), [&](int64_t a, int64_t b) {
        return found_[At(a)] < found_[At(b)];
      }));
      patches_ = SomePatches(clip_, tracks_, *part_);
    }
    hinge_ = NearestHinge(*part_, known_);
    if (!hinge_ || lost_.empty()) return false;
    for (const int64_t t : known_) {
      low_ = std::min(low_, hinge_->angle[At(t)] - kBeyond);
      high_ = std::max(high_, hinge_->angle[At(t)] + kBeyond);
    }
    return true;
  }

  // The angle in frame t, between `low` and `high`, at which most is found.
  Sight Best(int64_t t, double low, double high) const {
    Hinge hinge = *hinge_;
    RigidPart part = *part_;
    Sight best;
    for (double angle = low; angle <= high; angle += kStep) {
      hinge.angle[At(t)] = angle;
      SetPoses(hinge, {t}, &part);
      const int64_t found = CountFound(clip_, patches_, part, t);
      if (found > best.found) best = {angle, found};
    }
    return best;
  }

  // Whether frame t, next to one with the angle `beside`, gets another angle. One near to that needs fewer points.
  bool Place(int64_t t, double beside, const Sight& anywhere) {
    const double now = Dot(ToVec3(part_->pose[At(t)].rotation), hinge_->axis);
    const auto score = [&](double angle, int64_t found) {
      return static_cast<double>(found) * (std::abs(angle - beside) <= kNear ? kNearCounts : 1);
    };
    hinge_->angle[At(t)] = part_->seen[At(t)] ? now : beside;
    const Sight near = Best(t, beside - kNear, beside + kNear);
    const Sight& best = score(near.angle, near.found) >= score(anywhere.angle, anywhere.found) ? near : anywhere;
    if (!part_->seen[At(t)]) {
      part_->seen[At(t)] = static_cast<double>(best.found) >= std::max(least_, static_cast<double>(kLeastFound));
      if (!part_->seen[At(t)]) return false;
      hinge_->angle[At(t)] = best.angle;
      SetPoses(*hinge_, {t}, part_);
      return true;
    }
    if (best.found < kLeastFound) {
      part_->seen[At(t)] = found_[At(t)] >= kLeastKept;
      return false;
    }
    if (std::abs(best.angle - now) <= 2 * kStep || score(best.angle, best.found) <= score(now, found_[At(t)])) {
      return false;
    }
    hinge_->angle[At(t)] = best.angle;
    SetPoses(*hinge_, {t}, part_);
    return true;
  }

  const Clip& clip_;
  const std::vector<FlowTrack>& tracks_;
  RigidPart* part_;
  std::vector<PointPatch> patches_;
  std::vector<int64_t> seen_, known_, lost_;
  std::vector<int64_t> found_;  // T, where the part was; 0 in frames that do not see it
  double least_ = 0;            // of them, in a frame that is known
  std::optional<Hinge> hinge_;
  double low_ = INFINITY, high_ = -INFINITY;
};

}  // namespace

int64_t FindLostAngles(const Clip& clip, const std::vector<FlowTrack>& tracks, RigidPart* part) {
  return HingeSearch(clip, tracks, part).Run();
}

}  // namespace editnerf
