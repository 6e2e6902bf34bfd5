#include "libeditnerf/editing/point_track.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/tracking/flow_sequence.h"

namespace editnerf {
namespace {

torch::Tensor Shrunk(const torch::Tensor& image, int64_t longest_side) {
  const int64_t height = image.size(0), width = image.size(1), longest = std::max(height, width);
  if (longest <= longest_side) return image;
  const auto side = [&](int64_t size) {
    return std::max<int64_t>(std::llround(1.0 * size * longest_side / longest), 1);
  };
  return ResizeByArea(image, side(height), side(width));
}

[[noreturn]] void Lost(const std::string& name, int64_t frame, const char* why) {
  Throw<DataError>("{}: the point is lost at frame {}: {}; choose another point, or frames before that", name, frame,
                   why);
}

}  // namespace

PointTrack TrackPoint(FrameReader& frames, const OpticalFlow& flow, const PointTrackOptions& options,
                      const std::string& name, const std::function<void(int64_t, int64_t)>& progress) {
  std::optional<torch::Tensor> image;
  for (int64_t i = 0; i <= options.first_frame; ++i) {
    image = frames.Next();
    if (!image) Throw<DataError>("{}: there is no frame {}; it has {}, numbered from 0", name, options.first_frame, i);
  }
  PointTrack track;
  track.first_frame = options.first_frame;
  track.fps = frames.fps();
  track.height = image->size(0);
  track.width = image->size(1);
  const Pixel& start = options.start;
  if (!InsideImage(start, track.width, track.height)) {
    Throw<DataError>("{}: the point {},{} is not in the picture, which has {} x {} pixels", name, start.u, start.v,
                     track.width, track.height);
  }
  const int64_t end = std::min(frames.frame_count() - 1, options.last_frame) + 1;
  const int64_t total = std::max<int64_t>(end - options.first_frame, 0);
  torch::Tensor before = Shrunk(*image, options.longest_side);
  const double shrunk = static_cast<double>(before.size(1)) / static_cast<double>(track.width);
  Pixel at = {start.u * shrunk, start.v * shrunk};
  track.at.push_back(start);
  int64_t doubtful = 0;
  for (int64_t frame = options.first_frame + 1; frame <= options.last_frame; ++frame) {
    image = frames.Next();
    if (!image) break;
    const torch::Tensor now = Shrunk(*image, options.longest_side);
    const torch::Tensor there = flow.Flow(before, now), back = flow.Flow(now, before);
    const FlowSample step = SampleFlow(there, ForwardBackwardValid(there, back), at);
    doubtful = step.checked ? 0 : doubtful + 1;
    if (!step.valid || doubtful > options.patience) {
      Lost(name, frame - std::max<int64_t>(doubtful - 1, 0),
           "what is there cannot be followed; something may cover it");
    }
    at = {at.u + step.du, at.v + step.dv};
    if (!InsideImage(at, now.size(1), now.size(0))) Lost(name, frame, "it leaves the picture");
    track.at.push_back({at.u / shrunk, at.v / shrunk});
    before = now;
    if (progress) progress(static_cast<int64_t>(track.at.size()), total);
  }
  if (track.at.size() < 2) Throw<DataError>("{}: expected at least two frames from {} on", name, options.first_frame);
  return track;
}

}  // namespace editnerf
