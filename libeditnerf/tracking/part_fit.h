// A rigid part while it grows: which tracks follow it where its pose is known, and least squares over them.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

struct PartSeed {
  int64_t frame = 0;
  Pixel pixel;
  double distance = 0;  // scene units; a guess
};

// `tracks` may grow outside. Frames are known where part().seen; a track follows the part where it stays within 2.5
// pixels at 320 wide of its point, and belongs to it where it does so in most of the known frames that it covers.
class PartFit {
 public:
  PartFit(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options,
          const DepthRange& range);

  // The given tracks, all of which cover the seed's frame, on a plane there that faces the camera.
  void Begin(const PartSeed& seed, const std::vector<size_t>& near);

  // A part that was fitted before goes on from where it is, in its kind of motion.
  void GoOn(const RigidPart& part);

  // Follows the points by their looks (part_alignment.h), along tracks that are appended to `tracks`, and solves again
  // in the same kind of motion. False, and the part as it was, where too few points are left.
  bool Align(std::vector<FlowTrack>* tracks);

  // Finds frame t's pose, beginning from that of frame `from`. False, and unknown as before, where too few follow.
  bool Extend(int64_t t, int64_t from);

  // Poses and points of all known frames, by the points that tell most of them; the others follow, or leave. False
  // where too few are left.
  bool SolveOnTheWay();
  bool SolveAtLast();

  // Solves from the part turned inside out too (part_reversal.h), keeps what leaves the lower cost, and says whether
  // that is the other: a solution that has fallen into the wrong one does not come out of it.
  bool TryInsideOut();

  // Goes over to another kind of motion and solves in it; false, and the part as it was, where nothing comes out.
  bool Become(PartMotion motion);

  // The same, but only where the tracks are explained about as well then, with at most so many times the mean miss:
  // what a freer motion explains beyond that is flow's errors.
  bool Simplify(PartMotion motion, double most_miss);

  // Of a part on a hinge: looks for it in the frames that do not look like it (hinge_search.h), and says whether it was
  // found in any.
  bool FindLost();

  // Of a part on a hinge: takes the frames that do not see it for known where flow carries it (hinge_flow.h); false
  // where there are none. KeepFollowed leaves those that enough points follow in by now, and solves again.
  bool FollowFlow();
  bool KeepFollowed();

  // Moves the part to the distance at which it rests, or else has the shortest way to go (part_scale.h). One that is
  // held stays, as at any other distance what holds it would not stand still.
  void Settle();

  // Where on its ray a point's first track follows the part best; false where it does not follow.
  bool Triangulate(PartPoint* point) const;

  // How much better the part explains the point's first track than a static point does (stillness.h): a mean cost over
  // known frames; the most where the range of static points is unknown.
  double Gain(const PartPoint& point) const;

  void Add(const PartPoint& point) { part_.points.push_back(point); }
  void AddTrack(size_t point, size_t track) { part_.points[point].tracks.push_back(track); }
  void SetPoints(const std::vector<PartPoint>& points) { part_.points = points; }

  // The track of a point that covers frame t, or null.
  const FlowTrack* TrackIn(const PartPoint& point, int64_t t) const;

  int64_t Observations() const;  // pixels that follow

  // How well the tracks follow, and whether they do so about as well as `other`: with at most so many times its mean
  // miss, and at least that share of its pixels.
  struct Follow {
    int64_t pixels = 0;  // that follow
    double miss = 0;     // pixels, mean over all, none counted for more than an outlier
  };
  Follow Following() const;
  static bool IsLike(const Follow& now, const Follow& other, double most_miss, double least_share);

  const RigidPart& part() const { return part_; }

  // The part without the few frames in which it was lost, and with poses of unknown ones: where flow carries what is on
  // a hinge, as far as it does, and else as in FillUnseen (part_held.h).
  RigidPart Finished() const;

 private:
  struct Placement {
    Mat3 turn;
    Vec3 center;
  };
  static constexpr int64_t kLeastSeen = 4;  // points that follow, in a frame that sees the part

  struct Share {
    int64_t agree = 0, count = 0;
    bool Enough() const;
  };

  double Miss(const PartPoint& point, const FlowTrack& track, int64_t t) const;
  Share Agreement(const PartPoint& point, const FlowTrack& track) const;
  std::vector<int> Following(const PartPoint& point) const;  // pixels that follow in each frame
  std::vector<int> FollowingInFrames() const;
  bool Solve(size_t most_points, int iterations);
  bool SolveAgain();
  std::vector<PartPoint> SetAside(size_t most_points);
  std::optional<double> SolvePoints(int iterations);
  bool TakeBack(const std::vector<PartPoint>& rest);
  bool Prune();
  // Known ones in which too few pixels follow, a few between others in which enough do; but for the reference frame.
  std::vector<int64_t> LostFrames() const;
  void TakeLostBetween();
  void UpdatePlacement(int64_t t);
  void UpdatePlacements();

  const Clip& clip_;
  const std::vector<FlowTrack>& tracks_;
  PartSolverOptions options_;
  DepthRange range_;
  double inlier_;
  RigidPart part_;
  std::vector<Placement> placement_;  // T, of part_.pose
};

}  // namespace editnerf
