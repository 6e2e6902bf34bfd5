// One chosen point of a video, followed by optical flow that is checked forwards and backwards.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "libeditnerf/imaging/frame_reader.h"
#include "libeditnerf/tracking/map_lookup.h"
#include "libeditnerf/tracking/optical_flow.h"

namespace editnerf {

struct PointTrackOptions {
  Pixel start;                                               // in the first frame that is used, pixels of the video
  int64_t first_frame = 0;                                   // in which the point was chosen
  int64_t last_frame = std::numeric_limits<int64_t>::max();  // or the end of the video
  int64_t patience = 3;        // frames in a row for which flow that fails its check is still followed
  int64_t longest_side = 640;  // flow is measured in frames shrunk to this: it is what takes the time
};

struct PointTrack {
  std::vector<Pixel> at;  // from first_frame on, pixels of the video
  int64_t first_frame = 0;
  int64_t width = 0, height = 0;
  double fps = 24;
};

// `name` starts the messages. `progress(frames, total)` is called after each frame, total 0 where unknown; it may throw
// to stop. Throws DataError where the point is not in the picture, fewer than two frames are there, or the point is
// lost: it leaves the picture, or for more than `patience` frames the flow there and back disagree (something covers
// it). The message says at which frame.
PointTrack TrackPoint(FrameReader& frames, const OpticalFlow& flow, const PointTrackOptions& options,
                      const std::string& name, const std::function<void(int64_t done, int64_t total)>& progress = {});

}  // namespace editnerf
