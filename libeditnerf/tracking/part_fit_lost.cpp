// Frames in which a part is lost, and those that show other sides of it.
#include <algorithm>

#include "libeditnerf/tracking/hinge_flow.h"
#include "libeditnerf/tracking/hinge_search.h"
#include "libeditnerf/tracking/part_fit.h"
#include "libeditnerf/tracking/part_held.h"

namespace editnerf {
namespace {

constexpr size_t kMostLost = 3;  // frames in a row that it must have been lost in

size_t At(int64_t t) { return static_cast<size_t>(t); }

}  // namespace

std::vector<int> PartFit::FollowingInFrames() const {
  std::vector<int> following(part_.seen.size(), 0);
  for (const PartPoint& point : part_.points) {
    const std::vector<int> of_point = Following(point);
    for (size_t t = 0; t < following.size(); ++t) following[t] += of_point[t];
  }
  return following;
}

std::vector<int64_t> PartFit::LostFrames() const {
  const std::vector<int> following = FollowingInFrames();
  const auto empty = [&](int64_t t) { return following[At(t)] < kLeastSeen; };
  std::vector<int64_t> lost;
  const std::vector<int64_t> seen = SeenFrames(part_);
  for (size_t first = 0; first < seen.size(); ++first) {
    if (!empty(seen[first])) continue;
    size_t end = first;
    while (end < seen.size() && empty(seen[end])) ++end;
    if (first > 0 && end < seen.size() && end - first <= kMostLost)
      for (size_t i = first; i < end; ++i)
        if (seen[i] != part_.reference) lost.push_back(seen[i]);
    first = end;
  }
  return lost;
}

// Of a part that is held, whose way between two frames is known. What robust least squares has lost it does not find
// again by itself, as all that it could see counts as outliers there.
void PartFit::TakeLostBetween() {
  if (!IsHeld(part_.motion)) return;
  RigidPart known = part_;
  for (const int64_t t : LostFrames()) known.seen[At(t)] = false;
  FillUnseen(&known);
  part_.pose = known.pose;
  UpdatePlacements();
}

bool PartFit::FollowFlow() {
  if (part_.motion != PartMotion::kHinge) return false;
  const std::vector<int64_t> followed = FollowFlowOnHinge(clip_, &part_);
  for (const int64_t t : followed) part_.seen[At(t)] = true;
  UpdatePlacements();
  return !followed.empty();
}

bool PartFit::KeepFollowed() {
  const std::vector<int> following = FollowingInFrames();
  for (size_t t = 0; t < following.size(); ++t)
    if (following[t] < kLeastSeen && static_cast<int64_t>(t) != part_.reference) part_.seen[t] = false;
  return SolveAgain();
}

bool PartFit::FindLost() {
  if (part_.motion != PartMotion::kHinge) return false;
  const bool found = FindLostAngles(clip_, tracks_, &part_) > 0;
  UpdatePlacements();  // its reference may be another frame now, wherever it was found
  return found;
}

RigidPart PartFit::Finished() const {
  RigidPart part = part_;
  part.observations = Observations();
  for (const int64_t t : LostFrames()) part.seen[At(t)] = false;
  FillUnseen(&part);
  if (part.motion == PartMotion::kHinge) FollowFlowOnHinge(clip_, &part);
  return part;
}

}  // namespace editnerf
