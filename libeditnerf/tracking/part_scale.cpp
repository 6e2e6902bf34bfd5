#include "libeditnerf/tracking/part_scale.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/percentile.h"

namespace editnerf {
namespace {

constexpr double kMostRescaled = 2.2;  // either way
constexpr int kSteps = 80;             // to each side
constexpr double kMapSlack = 0.1;      // of the distance: a map that is further off says nothing
constexpr double kMapShare = 0.5;      // of the shortest way, that all maps together count for

constexpr double kMostOff = 0.25;           // of the scale, that rests can mend
constexpr int kFineSteps = 1250;            // to each side
constexpr double kStill = 0.3;              // pixels at 320 wide: a way that counts by half
constexpr double kLeastRest = 4;            // ways that count, over all lags
constexpr double kLeastPeak = 2.5;          // times what there is at half of all scales
constexpr double kLeastCertain = 0.005;     // standard deviation of the scale that rests leave
constexpr int64_t kLags[] = {2, 4, 8, 16};  // frames

size_t At(int64_t t) { return static_cast<size_t>(t); }

// Where every few of the part's points are in the frames that see it, one row a point.
std::vector<std::vector<Vec3>> Ways(const RigidPart& part, const std::vector<int64_t>& frames) {
  constexpr size_t kPoints = 20;
  const size_t stride = std::max<size_t>(1, part.points.size() / kPoints);
  std::vector<std::vector<Vec3>> ways;
  for (size_t k = 0; k < part.points.size(); k += stride) {
    ways.emplace_back();
    for (const int64_t t : frames) ways.back().push_back(part.Place(t, ToVec3(part.points[k].position)));
  }
  return ways;
}

double Length(const Clip& clip, const std::vector<std::vector<Vec3>>& ways, const std::vector<int64_t>& frames,
              double s) {
  double length = 0;
  for (const std::vector<Vec3>& way : ways) {
    Vec3 last;
    for (size_t i = 0; i < way.size(); ++i) {
      const Vec3& eye = clip.cameras[At(frames[i])].position;
      const Vec3 now = eye + (way[i] - eye) * s;
      if (i > 0) length += Norm(now - last);
      last = now;
    }
  }
  return length;
}

// Logarithms of the depth maps' distances over the part's, at some of its pixels.
std::vector<double> MapRatios(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part) {
  constexpr size_t kPoints = 60;
  constexpr int64_t kEvery = 4;
  std::vector<double> ratios;
  const size_t stride = std::max<size_t>(1, part.points.size() / kPoints);
  for (size_t k = 0; k < part.points.size(); k += stride) {
    for (const size_t i : part.points[k].tracks) {
      for (int64_t t = tracks[i].first; t < tracks[i].end(); t += kEvery) {
        if (!part.seen[At(t)]) continue;
        const double mapped = LocalDepth(clip.depth[At(t)], tracks[i].At(t), 1);
        const Vec3 place = part.Place(t, ToVec3(part.points[k].position));
        if (mapped > 0) ratios.push_back(std::log(mapped / Norm(place - clip.cameras[At(t)].position)));
      }
    }
  }
  return ratios;
}

}  // namespace

RigidPart ScaledFromCameras(const Clip& clip, const RigidPart& part, double s) {
  RigidPart scaled = part;
  const Vec3 eye = clip.cameras[At(part.reference)].position;
  const auto farther = [s](const Vec3& from, const Vec3& p) { return from + (p - from) * s; };
  scaled.center = farther(eye, part.center);
  for (PartPoint& point : scaled.points) point.position = ToArray(farther(eye, ToVec3(point.position)));
  for (int64_t t = 0; t < clip.num_frames(); ++t) {
    const Vec3 center = farther(clip.cameras[At(t)].position, part.Place(t, part.center));
    scaled.pose[At(t)].translation = ToArray(center - scaled.center);
  }
  return scaled;
}

double ShortestWay(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part) {
  const std::vector<int64_t> frames = SeenFrames(part);
  const std::vector<std::vector<Vec3>> ways = Ways(part, frames);
  const std::vector<double> ratios = MapRatios(clip, tracks, part);
  std::vector<double> scale, length, missed;
  for (int i = -kSteps; i <= kSteps; ++i) {
    const double log_s = i * std::log(kMostRescaled) / kSteps;
    scale.push_back(std::exp(log_s));
    length.push_back(Length(clip, ways, frames, scale.back()) / scale.back());
    double sum = 0;
    for (const double ratio : ratios) sum += std::min(std::abs(ratio - log_s) / kMapSlack, 1.0);
    missed.push_back(ratios.empty() ? 0 : sum / static_cast<double>(ratios.size()));
  }
  const double shortest = std::max(*std::min_element(length.begin(), length.end()), 1e-9);
  size_t best = 0;
  double least = INFINITY;
  for (size_t i = 0; i < scale.size(); ++i) {
    const double cost = length[i] / shortest + kMapShare * missed[i];
    if (cost < least) least = cost, best = i;
  }
  return scale[best];
}

std::optional<double> RestingScale(const Clip& clip, const RigidPart& part) {
  const std::vector<int64_t> frames = SeenFrames(part);
  const std::vector<std::vector<Vec3>> ways = Ways(part, frames);
  // How far a point goes between two frames, and how much farther for every 100 % of scale; pixels at 320 wide.
  struct Step {
    Vec3 way, per_scale;
  };
  std::vector<Step> steps;
  for (const std::vector<Vec3>& way : ways) {
    for (size_t i = 0; i < frames.size(); ++i) {
      const Camera& camera = clip.cameras[At(frames[i])];
      const double pixels = camera.focal_length / clip.PixelScale() / Norm(way[i] - camera.position);
      for (const int64_t lag : kLags) {
        const size_t j = i + At(lag);
        if (j >= frames.size() || frames[j] - frames[i] != lag) continue;
        const Vec3 moved = way[j] - way[i], followed = clip.cameras[At(frames[j])].position - camera.position;
        steps.push_back({moved * pixels, (moved - followed) * pixels});
      }
    }
  }
  double best = 0, most = -1, certain = 0;
  std::vector<double> restings;
  for (int i = -kFineSteps; i <= kFineSteps; ++i) {
    const double by = kMostOff * i / kFineSteps;
    double resting = 0, information = 0;
    for (const Step& step : steps) {
      const Vec3 way = step.way + step.per_scale * by;
      const double share = kStill * kStill / (kStill * kStill + Dot(way, way));
      resting += share;
      information += share * share * Dot(step.per_scale, step.per_scale);
    }
    restings.push_back(resting);
    if (resting > most) most = resting, best = by, certain = information;
  }
  const double each = ways.empty() ? 1 : static_cast<double>(ways.size());  // points of one part agree: they count once
  const bool clear = most >= kLeastRest * each && most >= kLeastPeak * Percentile(std::move(restings), 0.5) &&
                     certain > 0 && kStill / std::sqrt(certain / each) < kLeastCertain;
  if (!clear) return std::nullopt;
  return 1 + best;
}

}  // namespace editnerf
