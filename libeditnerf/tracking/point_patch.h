// One patch for each point of a part: what a frame shows there, and how it looks in other frames, as the part and the
// cameras carry it along.
//
// A patch is aligned with a frame as by Lucas and Kanade (1981), by the template's gradient (Baker and Matthews, IJCV
// 2004).
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/rigid_part.h"
#include "libeditnerf/tracking/stillness.h"

namespace editnerf {

// A 2 x 2 matrix, from pixels of the patch to those of another frame.
struct PatchWarp {
  double uu = 1, uv = 0, vu = 0, vv = 1;

  double Determinant() const { return uu * vv - uv * vu; }  // negative where its back is seen
  Pixel operator()(double du, double dv) const { return {uu * du + uv * dv, vu * du + vv * dv}; }
};

class PointPatch {
 public:
  // In the middle of the point's longest track.
  PointPatch(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part, const PartPoint& point);

  int64_t frame() const { return frame_; }
  const Pixel& center() const { return center_; }
  const Vec3& position() const { return position_; }  // in the part's reference frame

  bool HasCorner() const;  // something to hold on to

  // How the patch comes from its frame to frame t: all zeros where it cannot be seen, and whether it is neither too
  // small nor too large there to be compared.
  PatchWarp WarpTo(const Clip& clip, const RigidPart& part, int64_t t) const;
  static bool IsComparable(const PatchWarp& warp);

  // Turns the surface to where the patch looks most like what was seen: points that are off by little make out a plane
  // that is off by a lot.
  void FitNormal(const Clip& clip, const RigidPart& part, const std::vector<Sighting>& seen);

  // Moves `at` to where frame t looks like the patch, not far from where it was; false, and `at` somewhere,
  // where nothing does.
  bool Find(const Clip& clip, int64_t t, const PatchWarp& warp, Pixel* at) const;

 private:
  double Align(const torch::Tensor& gray, const PatchWarp& warp, int most_steps, Pixel* at) const;
  double Likeness(const Clip& clip, const RigidPart& part, const std::vector<Sighting>& seen) const;

  int64_t frame_;
  Pixel center_;
  Vec3 position_, normal_;  // a unit vector across the surface, in the part's reference frame
  std::vector<Pixel> offset_, gradient_;
  std::vector<double> value_;  // with zero mean and unit length
  double deviation_ = 0;       // the length that the values had
};

}  // namespace editnerf
