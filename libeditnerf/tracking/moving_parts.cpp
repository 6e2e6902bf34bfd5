#include "libeditnerf/tracking/moving_parts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/progress.h"

namespace editnerf {
namespace {

constexpr int kMostSeeds = 16;
constexpr int kMostInVain = 4;         // seeds in a row that give nothing that weighs
constexpr double kLeastWeight = 0.25;  // of the heaviest part's
constexpr double kCrowd = 10;          // pixels at 320 wide around a seed in which tracks are counted
constexpr int64_t kMostFrames = 40;    // that a track counts for
constexpr double kSurround = 20;       // pixels at 320 wide within which a pixel must be surrounded by its part
constexpr double kWidestGap = 2.6;     // radians without a neighbour
constexpr double kSlack = 2.5;         // pixels at 320 wide between a part's point and its track
constexpr float kTolerance = 0.01F;    // share of the distance

size_t At(int64_t i) { return static_cast<size_t>(i); }
Vec3 ToVec3(const std::array<double, 3>& p) { return {p[0], p[1], p[2]}; }

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<int64_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<int64_t> SeenFrames(const RigidPart& part) {
  std::vector<int64_t> frames;
  for (size_t t = 0; t < part.seen.size(); ++t)
    if (part.seen[t]) frames.push_back(static_cast<int64_t>(t));
  return frames;
}

// Every few points, so that a part of a thousand costs what one of forty does.
std::vector<Vec3> SomePoints(const RigidPart& part) {
  constexpr size_t kCount = 40;
  const size_t stride = std::max<size_t>(1, part.points.size() / kCount);
  std::vector<Vec3> points;
  for (size_t i = 0; i < part.points.size(); i += stride) points.push_back(ToVec3(part.points[i].position));
  return points;
}

double RangePixels(const Clip& clip, const RigidPart& part) {
  const std::vector<int64_t> frames = SeenFrames(part);
  const double distance = Norm(part.center - clip.cameras[At(part.reference)].position);
  std::vector<double> ranges;
  for (const Vec3& point : SomePoints(part)) ranges.push_back(PointRange(part, point, frames));
  return Quantile(ranges, 0.5) * clip.cameras[0].focal_length / distance / clip.PixelScale();
}

// The untaken track with the longest and most others around it.
class Crowds {
 public:
  Crowds(const Clip& clip, const std::vector<FlowTrack>& tracks)
      : reach_(kCrowd * clip.PixelScale()), tracks_(tracks), spent_(tracks.size(), false) {}

  // Index of the track, or the number of tracks where there is none.
  size_t Next(const std::vector<bool>& taken) {
    constexpr size_t kStride = 2;
    size_t best = tracks_.size();
    int64_t most = 0;
    spent_.resize(tracks_.size(), true);
    for (size_t i = 0; i < tracks_.size(); i += kStride) {
      if (taken[i] || spent_[i]) continue;
      int64_t crowd = 0;
      for (size_t j = 0; j < tracks_.size(); j += kStride)
        if (!taken[j] && Beside(i, j)) crowd += std::min(kMostFrames, tracks_[j].end() - tracks_[j].first);
      if (crowd > most) most = crowd, best = i;
    }
    return best;
  }

  void Spend(size_t seed, bool around) {
    for (size_t i = 0; i < spent_.size(); ++i)
      if (i == seed || (around && Beside(seed, i))) spent_[i] = true;
  }

 private:
  bool Beside(size_t seed, size_t other) const {
    const int64_t t = tracks_[seed].seed;
    return tracks_[other].Covers(t) && Distance(tracks_[other].At(t), tracks_[seed].At(t)) < reach_;
  }

  double reach_;
  const std::vector<FlowTrack>& tracks_;
  std::vector<bool> spent_;
};

// Whether neighbours lie on all sides.
bool Surrounded(const Pixel& p, const std::vector<Pixel>& others, double reach) {
  std::vector<double> angles;
  for (const Pixel& other : others) {
    const double off = Distance(p, other);
    if (off > 0 && off < reach) angles.push_back(std::atan2(other.v - p.v, other.u - p.u));
  }
  if (angles.size() < 3) return false;
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2 * M_PI - angles.back();
  for (size_t i = 0; i + 1 < angles.size(); ++i) gap = std::max(gap, angles[i + 1] - angles[i]);
  return gap < kWidestGap;
}

}  // namespace

bool MovesAs(const Clip& clip, const RigidPart& part, const RigidPart& other) {
  std::vector<int64_t> frames;
  for (const int64_t t : SeenFrames(part))
    if (other.seen[At(t)]) frames.push_back(t);
  if (frames.size() < 5) return false;
  // Seen from the cameras: two fits of one part may differ in how far away they have it.
  std::vector<double> off, range;
  for (const Vec3& point : SomePoints(part)) {
    const Vec3 held = other.TakeBack(frames.front(), part.Place(frames.front(), point));
    double u0 = NAN, v0 = NAN;
    for (const int64_t t : frames) {
      const Projected a = Project(clip.cameras[At(t)], part.Place(t, point));
      const Projected b = Project(clip.cameras[At(t)], other.Place(t, held));
      const Projected still = Project(clip.cameras[At(t)], part.Place(frames.front(), point));
      if (!a.valid || !b.valid || !still.valid) continue;
      u0 = a.u - still.u, v0 = a.v - still.v;
      off.push_back(std::hypot(a.u - b.u, a.v - b.v));
      range.push_back(std::hypot(u0, v0));
    }
  }
  return Quantile(off, 0.5) < 0.5 * Quantile(range, 0.8);
}

MovingParts FindMovingParts(const Clip& clip, const MotionEvidence& motion, DirectFlows* direct, double near,
                            double far) {
  MovingParts found;
  found.tracks = TrackMovingPixels(clip, motion, near, far);
  std::vector<bool> taken(found.tracks.size(), false);
  Crowds crowds(clip, found.tracks);
  double heaviest = 0;
  int in_vain = 0;
  PartSolverOptions options;
  Progress progress("moving parts", kMostSeeds);
  for (int i = 0; i < kMostSeeds && in_vain < kMostInVain; ++i) {
    progress.Update(i);
    const size_t track = crowds.Next(taken);
    if (track == found.tracks.size()) break;
    PartSeed seed = {found.tracks[track].seed, found.tracks[track].At(found.tracks[track].seed), NAN};
    seed.distance = LocalDepth(clip.depth[At(seed.frame)], seed.pixel, 1);
    std::optional<RigidPart> body;
    if (std::isfinite(seed.distance)) body = GrowPart(clip, direct, seed, &found.tracks, &taken, options);
    crowds.Spend(track, !body);
    ++in_vain;
    if (!body) continue;
    MovingPart part;
    part.range = RangePixels(clip, *body);
    part.weight = part.range * static_cast<double>(body->observations);
    part.body = std::move(*body);
    if (part.weight > kLeastWeight * heaviest) in_vain = 0;
    if (part.weight > heaviest) {
      heaviest = part.weight;
      options.look_again_from = part.body.observations / 4;
    }
    found.parts.push_back(std::move(part));
  }
  progress.Finish();
  std::stable_sort(found.parts.begin(), found.parts.end(),
                   [](const MovingPart& a, const MovingPart& b) { return a.weight > b.weight; });
  std::vector<MovingPart> own;
  for (MovingPart& part : found.parts) {
    const bool again = std::any_of(own.begin(), own.end(), [&](const MovingPart& heavier) {
      return MovesAs(clip, part.body, heavier.body);
    });
    if (!again && part.weight >= kLeastWeight * heaviest) own.push_back(std::move(part));
  }
  found.parts = std::move(own);
  return found;
}

DepthTargets PartDepths(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part) {
  std::vector<int64_t> frame, pixel;
  std::vector<float> distance;
  for (const int64_t t : SeenFrames(part)) {
    std::vector<Pixel> pixels;
    std::vector<double> distances;
    for (const PartPoint& point : part.points) {
      for (const size_t i : point.tracks) {
        if (!tracks[i].Covers(t)) continue;
        const Vec3 place = part.Place(t, ToVec3(point.position));
        const Projected at = Project(clip.cameras[At(t)], place);
        if (!at.valid || Distance({at.u, at.v}, tracks[i].At(t)) > kSlack * clip.PixelScale()) continue;
        pixels.push_back(tracks[i].At(t));
        distances.push_back(Norm(place - clip.cameras[At(t)].position));
        break;
      }
    }
    for (size_t i = 0; i < pixels.size(); ++i) {
      if (!Surrounded(pixels[i], pixels, kSurround * clip.PixelScale())) continue;
      frame.push_back(t);
      pixel.push_back(static_cast<int64_t>(pixels[i].u));
      pixel.push_back(static_cast<int64_t>(pixels[i].v));
      distance.push_back(static_cast<float>(distances[i]));
    }
  }
  const auto count = static_cast<int64_t>(distance.size());
  DepthTargets targets;
  targets.frame = torch::tensor(frame, torch::kInt64);
  targets.pixel = torch::tensor(pixel, torch::kInt64).view({count, 2});
  targets.distance = torch::tensor(distance, torch::kFloat32);
  targets.tolerance = torch::full({count}, kTolerance);
  return targets;
}

}  // namespace editnerf
