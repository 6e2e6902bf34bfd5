#include "libeditnerf/tracking/track_relation.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/median_point.h"

namespace editnerf {
namespace {

constexpr int64_t kLeastCommonFrames = 5;
constexpr double kLeastCorrelation = 0.6;

double Correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double mean_a = 0, mean_b = 0, aa = 0, bb = 0, ab = 0;
  const auto count = static_cast<double>(a.size());
  for (size_t i = 0; i < a.size(); ++i) mean_a += a[i] / count, mean_b += b[i] / count;
  for (size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
    ab += (a[i] - mean_a) * (b[i] - mean_b);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

}  // namespace

TrackMotion MeasureTrackMotion(const PointTrack& track) {
  std::vector<Vec3> points;
  std::vector<double> bends;
  for (size_t t = 0; t < track.position.size(); ++t) {
    if (!track.visible[t]) continue;
    points.push_back(track.position[t]);
    if (t < 2 || !track.visible[t - 1] || !track.visible[t - 2]) continue;
    bends.push_back(Norm(track.position[t] - 2 * track.position[t - 1] + track.position[t - 2]));
  }
  TrackMotion motion;
  motion.frames = static_cast<int64_t>(points.size());
  if (points.empty()) return motion;
  const Vec3 center = MedianPoint(points);
  std::vector<double> distances;
  for (const Vec3& p : points) distances.push_back(Norm(p - center));
  motion.range = Percentile(distances, 0.95);
  // A second difference of independent noise has variance 6 sigma^2 along the one noisy direction, the ray; the median
  // of the absolute value of a normal variable is 0.6745 of its standard deviation.
  motion.noise = Percentile(bends, 0.5) / (0.6745 * std::sqrt(6.0));
  return motion;
}

TrackRelation RelateTracks(const PointTrack& a, const PointTrack& b) {
  std::vector<Vec3> pa, pb;
  std::vector<size_t> frame;
  for (size_t t = 0; t < a.position.size(); ++t) {
    if (!a.visible[t] || !b.visible[t]) continue;
    pa.push_back(a.position[t]);
    pb.push_back(b.position[t]);
    frame.push_back(t);
  }
  TrackRelation relation;
  relation.frames = static_cast<int64_t>(pa.size());
  if (pa.size() < 2) return relation;
  std::vector<double> distances, speed_a, speed_b;
  const Vec3 center_a = MedianPoint(pa), center_b = MedianPoint(pb);
  double aa = 0, bb = 0, ab = 0;
  for (size_t i = 0; i < pa.size(); ++i) {
    distances.push_back(Norm(pa[i] - pb[i]));
    const Vec3 da = pa[i] - center_a, db = pb[i] - center_b;
    aa += Dot(da, da), bb += Dot(db, db), ab += Dot(da, db);
  }
  const size_t lag = std::max<size_t>(1, pa.size() / 16);
  for (size_t i = lag; i < pa.size(); ++i) {
    const auto span = static_cast<double>(frame[i] - frame[i - lag]);
    speed_a.push_back(Norm(pa[i] - pa[i - lag]) / span);
    speed_b.push_back(Norm(pb[i] - pb[i - lag]) / span);
  }
  relation.distance_spread = Percentile(distances, 0.9) - Percentile(distances, 0.1);
  relation.synchrony = Correlation(speed_a, speed_b);
  relation.parallelism = aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
  return relation;
}

bool SameRigidPart(const PointTrack& a, const PointTrack& b, double merge_distance) {
  const TrackRelation relation = RelateTracks(a, b);
  if (relation.frames < kLeastCommonFrames) return false;
  const TrackMotion motion_a = MeasureTrackMotion(a), motion_b = MeasureTrackMotion(b);
  // 2.56 standard deviations lie between the 10th and the 90th percentile of noise.
  const double noise = 2.56 * std::hypot(motion_a.noise, motion_b.noise);
  if (relation.distance_spread >= merge_distance * std::min(motion_a.range, motion_b.range) + noise) return false;
  return std::max(relation.synchrony, relation.parallelism) > kLeastCorrelation;
}

}  // namespace editnerf
