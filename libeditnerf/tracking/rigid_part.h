// A part that moves as one rigid body: its way through the frames, and the points on its surface that show it.
//
// With the cameras known, flow tracks on a rigid part give its shape and its motion as structure from motion does, up
// to one number: were the part s times as far from every camera, and s times as large, the images would be the same
// (the monocular ambiguity; Ozden et al., ICCV 2004, choose s so that the part does not follow the camera).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

struct RigidPose {
  std::array<double, 3> rotation = {0, 0, 0};     // angle-axis, about the part's centre
  std::array<double, 3> translation = {0, 0, 0};  // scene units
};

struct PartPoint {
  std::vector<size_t> tracks;                  // the flow tracks of this point; several, where it was lost in between
  std::array<double, 3> position = {0, 0, 0};  // scene units, where it lies in the reference frame
};

enum class PartMotion {
  kFree,
  kNoTurns,  // goes anywhere
  kPlane,    // on one plane that stands still in the scene, and does not turn (part_slide.h)
  kRail,     // along one line that stands still in the scene, and does not turn (part_slide.h)
  kHinge,    // about one axis that stands still in the scene (part_hinge.h)
};

const char* NameOf(PartMotion motion);  // "freely", "without turns", "on a plane", "on a rail", "on a hinge"

// Whether it stays on what stands still: at a distance that is wrong it could not.
inline bool IsHeld(PartMotion motion) { return motion != PartMotion::kFree && motion != PartMotion::kNoTurns; }

struct RigidPart {
  int64_t reference = 0;          // frame whose pose is the identity
  Vec3 center;                    // scene units, in the reference frame
  std::vector<RigidPose> pose;    // T
  std::vector<bool> seen;         // T: enough of its points are seen; other poses are those of the nearest seen frame
  std::vector<PartPoint> points;  // those whose tracks follow the part
  int64_t observations = 0;       // pixels of those tracks that do
  PartMotion motion = PartMotion::kFree;

  bool turns() const { return motion == PartMotion::kFree || motion == PartMotion::kHinge; }

  // Scene points in frame t of what lies at `position` in the reference frame, and back.
  Vec3 Place(int64_t t, const Vec3& position) const;
  Vec3 TakeBack(int64_t t, const Vec3& point) const;
};

inline Vec3 ToVec3(const std::array<double, 3>& p) { return {p[0], p[1], p[2]}; }
inline std::array<double, 3> ToArray(const Vec3& p) { return {p.x, p.y, p.z}; }

// The same part and the same way, with another frame as its reference.
RigidPart ReferredTo(const RigidPart& part, int64_t frame);

// Rotation vectors [T, 3] of the part's axes, from those in the reference frame.
std::vector<Vec3> TurnsOf(const RigidPart& part);

std::vector<int64_t> SeenFrames(const RigidPart& part);  // in time order

// One number a frame: sets those of frames that do not see the part, and returns these frames. Between two that do it
// changes steadily; but where it moves at one of them and rests at the other, it keeps its pace until it is there.
// Before the first and behind the last it stays, or keeps its pace as far as it was ever seen to go.
std::vector<int64_t> FillBetween(const RigidPart& part, std::vector<double>* values);

// How far a point goes in the frames that see the part: TrackMotion::range (track_relation.h), scene units.
double PointRange(const RigidPart& part, const Vec3& position);

}  // namespace editnerf
