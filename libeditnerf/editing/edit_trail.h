// A trail: key frames of key point positions and cameras over time, and the edit file that they make.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/scene/scene.h"

namespace editnerf {

struct TrailFrame {
  double time = 0;  // seconds
  std::vector<Vec3> key_points;
  Camera camera;    // scene units
  int64_t row = 0;  // of the training frames: whose codes are used
};

class EditTrail {
 public:
  static constexpr size_t kMaxFrames = 5000;
  static constexpr double kMaxSeconds = 300;

  // Later than the last key frame, or at the same time, which replaces it. Throws DataError for an earlier time, for
  // one that is not finite or beyond kMaxSeconds after the first, and where the trail is full.
  void Add(const TrailFrame& frame);
  void Clear() { frames_.clear(); }

  // Of key frame `index`, numbered from 0: another state at its time; `seconds` after the first key frame, past others
  // where need be; or gone. The trail begins at the same time as before. Each throws DataError for an index without a
  // key frame; Move for a time before the first, beyond kMaxSeconds, or that of another key frame.
  void Replace(int64_t index, const TrailFrame& frame);
  void Move(int64_t index, double seconds);
  void Remove(int64_t index);

  const std::vector<TrailFrame>& frames() const { return frames_; }
  double Duration() const { return frames_.empty() ? 0 : frames_.back().time - frames_.front().time; }

  // The trail `seconds` (clamped) after its first key frame, which must exist. It begins and ends at rest, meets its
  // key frames exactly and passes them without a jump of velocity. Key points follow a smooth curve that never
  // overshoots a coordinate of the two key frames around it (monotone cubic, Fritsch and Carlson, 1980). Between
  // cameras that look at the same point, that point keeps its place in the picture and the camera turns around it;
  // other cameras go straight as they turn. Lens and row are those of the key frame before.
  TrailFrame At(double seconds) const;

  // round(Duration() * fps) + 1 frames, all with a camera in world units. `width` and `height` as in EditFile.
  // Throws DataError where there is no key frame or fps is not in (0, 120].
  EditFile ToEditFile(const Scene& scene, double fps, int64_t width = 0, int64_t height = 0) const;

 private:
  size_t Index(int64_t index) const;
  void BeginAt(double time);

  std::vector<TrailFrame> frames_;
};

}  // namespace editnerf
