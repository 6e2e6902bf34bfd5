#include "libeditnerf/tracking/part_reversal.h"

#include <ceres/rotation.h>

namespace editnerf {
namespace {

size_t At(int64_t t) { return static_cast<size_t>(t); }

// I - 2 n n^T for the unit vector n from the camera to the part's centre.
Mat3 MirrorOf(const Clip& clip, const RigidPart& part, int64_t t) {
  const Vec3 n = Normalized(part.Place(t, part.center) - clip.cameras[At(t)].position);
  return {{1 - 2 * n.x * n.x, -2 * n.x * n.y, -2 * n.x * n.z,  //
           -2 * n.x * n.y, 1 - 2 * n.y * n.y, -2 * n.y * n.z,  //
           -2 * n.x * n.z, -2 * n.y * n.z, 1 - 2 * n.z * n.z}};
}

}  // namespace

// With the mirrors H: points x go to H_0 x and turns R to H_t R H_0, so that each point goes from R x to H_t (R x).
RigidPart InsideOut(const Clip& clip, const RigidPart& part) {
  RigidPart mirrored = part;
  const Mat3 first = MirrorOf(clip, part, part.reference);
  for (PartPoint& point : mirrored.points)
    point.position = ToArray(part.center + first * (ToVec3(point.position) - part.center));
  for (int64_t t = 0; t < clip.num_frames(); ++t) {
    double columns[9];
    ceres::AngleAxisToRotationMatrix(part.pose[At(t)].rotation.data(), columns);
    const Mat3 turn = Mat3{
        {columns[0], columns[3], columns[6], columns[1], columns[4], columns[7], columns[2], columns[5], columns[8]}};
    const Mat3 turned = (MirrorOf(clip, part, t) * turn * first).Transposed();
    ceres::RotationMatrixToAngleAxis(turned.m.data(), mirrored.pose[At(t)].rotation.data());
  }
  return mirrored;
}

}  // namespace editnerf
