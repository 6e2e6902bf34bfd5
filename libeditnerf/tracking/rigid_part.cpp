#include "libeditnerf/tracking/rigid_part.h"

#include <ceres/rotation.h>

#include <algorithm>

#include "libeditnerf/tracking/track_relation.h"

namespace editnerf {

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
  for (int64_t t = 0; t < static_cast<int64_t>(part.pose.size()); ++t) {
    if (part.seen[static_cast<size_t>(t)]) continue;
    others.push_back(t);
    const auto after = std::upper_bound(seen.begin(), seen.end(), t);
    const int64_t b = after == seen.end() ? seen.back() : *after, a = after == seen.begin() ? b : *(after - 1);
    const double share = b > a ? static_cast<double>(t - a) / static_cast<double>(b - a) : 0;
    const auto value = [values](int64_t frame) { return (*values)[static_cast<size_t>(frame)]; };
    (*values)[static_cast<size_t>(t)] = (1 - share) * value(a) + share * value(b);
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
