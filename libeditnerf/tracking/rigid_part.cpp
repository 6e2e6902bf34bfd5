#include "libeditnerf/tracking/rigid_part.h"

#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/tracking/track_relation.h"

namespace editnerf {
namespace {

// One number a frame, in the frames that see the part.
class SeenValues {
 public:
  SeenValues(const RigidPart& part, const std::vector<int64_t>& seen, const std::vector<double>& values)
      : seen_(part.seen), values_(values) {
    low_ = high_ = At(seen.front());
    for (const int64_t t : seen) low_ = std::min(low_, At(t)), high_ = std::max(high_, At(t));
  }

  // Before the first or behind the last frame that sees it.
  double Beyond(int64_t last, int64_t t) const {
    const int64_t on = t > last ? 1 : -1;
    return std::clamp(At(last) + Pace(last, on) * static_cast<double>(std::abs(t - last)), low_, high_);
  }

  double Between(int64_t a, int64_t b, int64_t t) const {
    const double way = At(b) - At(a), from_a = Pace(a, 1), from_b = Pace(b, -1);
    if (from_b == 0 && IsSooner(from_a, way, b - a)) return At(a) + Going(from_a, way, t - a);
    if (from_a == 0 && IsSooner(from_b, -way, b - a)) return At(b) + Going(from_b, -way, b - t);
    return At(a) + way * static_cast<double>(t - a) / static_cast<double>(b - a);
  }

 private:
  // Of all its way, a frame, below which it counts as at rest; the eased ends of a motion are slow.
  static constexpr double kLeastPace = 0.02;

  double At(int64_t t) const { return values_[static_cast<size_t>(t)]; }
  bool Seen(int64_t t) const {
    return t >= 0 && t < static_cast<int64_t>(seen_.size()) && seen_[static_cast<size_t>(t)];
  }

  // With which it goes on from frame t, forwards (1) or backwards (-1), a frame.
  double Pace(int64_t t, int64_t on) const {
    if (!Seen(t - on)) return 0;
    const int64_t steps = Seen(t - 2 * on) ? 2 : 1;
    const double pace = (At(t) - At(t - steps * on)) / static_cast<double>(steps);
    return std::abs(pace) < kLeastPace * (high_ - low_) ? 0 : pace;
  }

  // Whether it goes the given way in fewer than the given frames.
  static bool IsSooner(double pace, double way, int64_t frames) {
    return pace * way > 0 && std::abs(pace) * static_cast<double>(frames) > std::abs(way);
  }

  static double Going(double pace, double way, int64_t frames) {
    return std::copysign(std::min(std::abs(pace) * static_cast<double>(frames), std::abs(way)), way);
  }

  const std::vector<bool>& seen_;
  const std::vector<double>& values_;
  double low_ = 0, high_ = 0;
};

}  // namespace

const char* NameOf(PartMotion motion) {
  switch (motion) {
    case PartMotion::kFree:
      return "freely";
    case PartMotion::kNoTurns:
      return "without turns";
    case PartMotion::kPlane:
      return "on a plane";
    case PartMotion::kRail:
      return "on a rail";
    case PartMotion::kHinge:
      return "on a hinge";
  }
  return "";
}

Vec3 RigidPart::Place(int64_t t, const Vec3& position) const {
  const RigidPose& p = pose[static_cast<size_t>(t)];
  const double from[3] = {position.x - center.x, position.y - center.y, position.z - center.z};
  double turned[3];
  ceres::AngleAxisRotatePoint(p.rotation.data(), from, turned);
  return {turned[0] + center.x + p.translation[0], turned[1] + center.y + p.translation[1],
          turned[2] + center.z + p.translation[2]};
}

Vec3 RigidPart::TakeBack(int64_t t, const Vec3& point) const {
  const RigidPose& p = pose[static_cast<size_t>(t)];
  const double back[3] = {-p.rotation[0], -p.rotation[1], -p.rotation[2]};
  const double from[3] = {point.x - center.x - p.translation[0], point.y - center.y - p.translation[1],
                          point.z - center.z - p.translation[2]};
  double turned[3];
  ceres::AngleAxisRotatePoint(back, from, turned);
  return {turned[0] + center.x, turned[1] + center.y, turned[2] + center.z};
}

RigidPart ReferredTo(const RigidPart& part, int64_t frame) {
  RigidPart referred = part;
  referred.reference = frame;
  referred.center = part.Place(frame, part.center);
  for (PartPoint& point : referred.points) point.position = ToArray(part.Place(frame, ToVec3(point.position)));
  const auto& first = part.pose[static_cast<size_t>(frame)].rotation;
  const double back[3] = {-first[0], -first[1], -first[2]};
  double undo[4], turn[4], both[4];
  ceres::AngleAxisToQuaternion(back, undo);
  for (size_t t = 0; t < part.pose.size(); ++t) {
    ceres::AngleAxisToQuaternion(part.pose[t].rotation.data(), turn);
    ceres::QuaternionProduct(turn, undo, both);
    ceres::QuaternionToAngleAxis(both, referred.pose[t].rotation.data());
    referred.pose[t].translation = ToArray(part.Place(static_cast<int64_t>(t), part.center) - referred.center);
  }
  return referred;
}

std::vector<Vec3> TurnsOf(const RigidPart& part) {
  std::vector<Vec3> turns;
  for (const RigidPose& pose : part.pose) turns.push_back(ToVec3(pose.rotation));
  return turns;
}

std::vector<int64_t> SeenFrames(const RigidPart& part) {
  std::vector<int64_t> frames;
  for (size_t t = 0; t < part.seen.size(); ++t)
    if (part.seen[t]) frames.push_back(static_cast<int64_t>(t));
  return frames;
}

std::vector<int64_t> FillBetween(const RigidPart& part, std::vector<double>* values) {
  const std::vector<int64_t> seen = SeenFrames(part);
  std::vector<int64_t> others;
  if (seen.empty()) return others;
  const SeenValues known(part, seen, *values);
  for (int64_t t = 0; t < static_cast<int64_t>(part.pose.size()); ++t) {
    if (part.seen[static_cast<size_t>(t)]) continue;
    others.push_back(t);
    const auto after = std::upper_bound(seen.begin(), seen.end(), t);
    double& value = (*values)[static_cast<size_t>(t)];
    if (after == seen.begin()) {
      value = known.Beyond(seen.front(), t);
    } else if (after == seen.end()) {
      value = known.Beyond(seen.back(), t);
    } else {
      value = known.Between(*(after - 1), *after, t);
    }
  }
  return others;
}

double PointRange(const RigidPart& part, const Vec3& position) {
  PointTrack track;
  for (size_t t = 0; t < part.seen.size(); ++t) track.position.push_back(part.Place(static_cast<int64_t>(t), position));
  track.visible = part.seen;
  return MeasureTrackMotion(track).range;
}

}  // namespace editnerf
