// Where key points were in training: what a drag takes its depth from, and how far an edit leaves what training saw.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/geometry/camera.h"

namespace editnerf {

// How far a key point lies from what training saw. The levels' limits are shares of the trajectory's extent, the
// longest side of the box around it (at least kSmallestTrackRange, field/key_points.h).
enum class ReachLevel { kNear, kFar, kBeyond };
constexpr double kFarReach = 0.15;    // from here on a picture may lose detail
constexpr double kBeyondReach = 0.4;  // from here on it is likely to come apart

struct Reach {
  double distance = 0;  // to the nearest position of training, scene units
  double share = 0;     // of the extent
  ReachLevel level = ReachLevel::kNear;
};

class KeyPointTracks {
 public:
  KeyPointTracks() = default;  // of a static scene: no key points

  // tracks [T, N, 3], T >= 1, scene units, any type and device. Throws ShapeError.
  explicit KeyPointTracks(const torch::Tensor& tracks);

  int64_t num_frames() const { return static_cast<int64_t>(rows_.size()); }
  int64_t num_key_points() const { return rows_.empty() ? 0 : static_cast<int64_t>(rows_.front().size()); }

  // All key points in training frame `row`, in [0, num_frames()).
  const std::vector<Vec3>& Row(int64_t row) const { return rows_[static_cast<size_t>(row)]; }

  // The middle of the box around everything.
  Vec3 Center() const;

  // The longest side of the box around the trajectory.
  double Extent(int64_t key_point) const;

  // The default depth of a drag: the mean depth, along the optical axis, of the `count` positions of this key point
  // that project nearest to pixel (u, v). Nothing where no position is in front of the camera.
  std::optional<double> DragDepth(const Camera& camera, int64_t key_point, double u, double v, int64_t count = 8) const;

  Reach ReachOf(int64_t key_point, const Vec3& position) const;

 private:
  std::vector<std::vector<Vec3>> rows_;  // [T][N]
};

}  // namespace editnerf
