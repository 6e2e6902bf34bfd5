#include "libeditnerf/editing/motion_transfer.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr double kLeastMotion = 0.5;     // pixels; below it flow measures nothing but its own error
constexpr double kLeastWidth = 0.05;     // of a motion's second axis, as a share of its first
constexpr double kStillPosition = 1e-6;  // scene units

torch::Tensor Rows(const std::vector<Pixel>& pixels) {
  auto rows = torch::empty({static_cast<int64_t>(pixels.size()), 2}, torch::kFloat64);
  double* next = rows.data_ptr<double>();
  for (const Pixel& p : pixels) *next++ = p.u, *next++ = p.v;
  return rows;
}

torch::Tensor Rows(const std::vector<Vec3>& positions) {
  auto rows = torch::empty({static_cast<int64_t>(positions.size()), 3}, torch::kFloat64);
  double* next = rows.data_ptr<double>();
  for (const Vec3& p : positions) *next++ = p.x, *next++ = p.y, *next++ = p.z;
  return rows;
}

Vec3 ToVec3(const torch::Tensor& v) { return {v[0].item<double>(), v[1].item<double>(), v[2].item<double>()}; }

// map [2, 3] of what lies around `from` [2] to what lies around `to` [3].
AffineMotion MotionOf(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& map, int64_t rank) {
  return {ToVec3(to - from.matmul(map)), ToVec3(map[0]), ToVec3(map[1]), rank};
}

// The principal axes of a motion: its middle and, along each axis, how far it reaches to either side.
struct Range {
  torch::Tensor middle;  // [D]
  torch::Tensor axes;    // [2, D], unit length, the longest first
  double reach[2] = {0, 0};
};

Range RangeOf(const torch::Tensor& rows) {
  const auto mean = rows.mean(0);
  const auto [_, spread, axes] = torch::linalg_svd(rows - mean, false, c10::nullopt);
  Range range;
  range.axes = axes.slice(0, 0, 2);
  // A motion of one or two frames has fewer directions than the space.
  while (range.axes.size(0) < 2) range.axes = torch::cat({range.axes, torch::zeros_like(range.axes.slice(0, 0, 1))});
  const auto along = (rows - mean).matmul(range.axes.t());
  const auto low = std::get<0>(along.min(0)), high = std::get<0>(along.max(0));
  range.middle = mean + (0.5 * (low + high)).matmul(range.axes);
  for (int64_t i = 0; i < 2; ++i) range.reach[i] = 0.5 * (high - low)[i].item<double>();
  return range;
}

// Whether a step of the key point along `step` is seen to go against the direction of the image.
bool SeenAgainst(const Camera& view, const torch::Tensor& place, const torch::Tensor& step,
                 const torch::Tensor& image) {
  const Projected from = Project(view, ToVec3(place - 0.5 * step)), to = Project(view, ToVec3(place + 0.5 * step));
  if (!from.valid || !to.valid) return false;
  return (to.u - from.u) * image[0].item<double>() + (to.v - from.v) * image[1].item<double>() < 0;
}

}  // namespace

AffineMotion FitPairs(const std::vector<Pixel>& pixels, const std::vector<Vec3>& positions) {
  if (pixels.size() != positions.size() || pixels.size() < 2) {
    Throw<DataError>("motion: expected at least two pairs of a video frame and a capture frame, found {}",
                     pixels.size());
  }
  const auto from = Rows(pixels), to = Rows(positions);
  const auto center = from.mean(0), target = to.mean(0);
  const auto [u, s, vh] = torch::linalg_svd(from - center, false, c10::nullopt);
  const double largest = s[0].item<double>();
  if (largest < kLeastMotion) {
    Throw<DataError>(
        "motion: the point is within {:.2f} pixels of one place in all pairs; choose frames between which it moves",
        largest);
  }
  // A direction in which the pixels spread by less than flow can tell has no say: the least of all maps that fit.
  auto inverse = torch::zeros_like(s);
  int64_t rank = 0;
  for (int64_t i = 0; i < s.size(0); ++i) {
    const double spread = s[i].item<double>();
    if (spread < std::max(kLeastMotion, 1e-3 * largest)) continue;
    inverse[i] = 1 / spread;
    ++rank;
  }
  const auto map = vh.t().matmul(torch::diag(inverse)).matmul(u.t()).matmul(to - target);
  return MotionOf(center, target, map, rank);
}

AffineMotion FitRanges(const std::vector<Pixel>& pixels, const std::vector<Vec3>& positions, const Camera& view,
                       bool reversed, int64_t axes) {
  if (pixels.empty() || positions.empty()) Throw<DataError>("motion: expected a track and positions, found none");
  const Range from = RangeOf(Rows(pixels)), to = RangeOf(Rows(positions));
  if (from.reach[0] < kLeastMotion) {
    Throw<DataError>("motion: the point stays within {:.2f} pixels of one place; choose one that moves", from.reach[0]);
  }
  if (to.reach[0] < kStillPosition) {
    Throw<DataError>("motion: the key point does not move in the capture, and so has no range; give pairs of frames");
  }
  auto map = torch::zeros({2, 3}, torch::kFloat64);
  int64_t rank = 0;
  for (int64_t axis = 0; axis < std::min<int64_t>(axes, 2); ++axis) {
    const bool both = from.reach[axis] >= std::max(kLeastWidth * from.reach[0], kLeastMotion) &&
                      to.reach[axis] >= kLeastWidth * to.reach[0];
    if (axis == 1 && !both) break;
    auto step = to.axes[axis] * to.reach[axis];
    if (SeenAgainst(view, to.middle, step, from.axes[axis]) != (reversed && axis == 0)) step = -step;
    map += torch::outer(from.axes[axis] / from.reach[axis], step);
    ++rank;
  }
  return MotionOf(from.middle, to.middle, map, rank);
}

void CheckKeyPoint(const KeyPointTracks& tracks, int64_t key_point) {
  const int64_t count = tracks.num_key_points();
  if (key_point < 0 || key_point >= count) {
    Throw<DataError>("key point {}: the run has {}{}", key_point, count, count > 0 ? ", numbered from 0" : "");
  }
}

std::vector<Vec3> TransferMotion(const PointTrack& track, const KeyPointTracks& tracks,
                                 const TransferOptions& options) {
  CheckKeyPoint(tracks, options.key_point);
  const auto position = [&](int64_t row) { return tracks.Row(row)[static_cast<size_t>(options.key_point)]; };
  AffineMotion motion;
  if (options.pairs.empty()) {
    std::vector<Vec3> visited;
    for (int64_t row = 0; row < tracks.num_frames(); ++row) visited.push_back(position(row));
    motion = FitRanges(track.at, visited, options.view, options.reversed, options.axes);
  } else {
    std::vector<Pixel> pixels;
    std::vector<Vec3> positions;
    for (const FramePair& pair : options.pairs) {
      const int64_t last = track.first_frame + static_cast<int64_t>(track.at.size()) - 1;
      if (pair.video_frame < track.first_frame || pair.video_frame > last) {
        Throw<DataError>("pair {}:...: expected a frame of the video from {} to {}", pair.video_frame,
                         track.first_frame, last);
      }
      if (pair.row < 0 || pair.row >= tracks.num_frames()) {
        Throw<DataError>("training frame {}: the run has {}, numbered from 0", pair.row, tracks.num_frames());
      }
      pixels.push_back(track.at[static_cast<size_t>(pair.video_frame - track.first_frame)]);
      positions.push_back(position(pair.row));
    }
    motion = FitPairs(pixels, positions);
  }
  std::vector<Vec3> path;
  path.reserve(track.at.size());
  for (const Pixel& p : track.at) path.push_back(motion.At(p));
  return path;
}

EditFile DrivenEdit(const std::vector<Vec3>& positions, int64_t key_point, double fps, const std::string& code_frame,
                    const std::string& camera_frame) {
  EditFile edit;
  edit.fps = fps;
  for (const Vec3& position : positions) {
    EditFrame frame;
    frame.key_points.resize(static_cast<size_t>(key_point) + 1);
    frame.key_points.back() = position;
    frame.code_frame = code_frame;
    frame.camera_frame = camera_frame;
    edit.frames.push_back(std::move(frame));
  }
  return edit;
}

}  // namespace editnerf
