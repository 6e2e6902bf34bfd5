#include "libeditnerf/tracking/volume_candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/tracking/stillness.h"
#include "libeditnerf/tracking/track_refinement.h"
#include "libeditnerf/tracking/track_relation.h"

namespace editnerf {
namespace {

constexpr size_t kCandidatesPerKeyPoint = 4;  // maxima examined for each key point that may be kept
constexpr size_t kReferenceTrials = 4;        // reference frames tried for each candidate
constexpr double kLeastMovingShare = 0.3;     // of the visible frames
constexpr int64_t kLeastMovingFrames = 3;
constexpr int64_t kLeastVisibleFrames = 4;
constexpr double kLeastVisibleShare = 0.15;  // of all frames
constexpr double kLeastRange = 0.01;         // of the point's median distance from the camera
constexpr double kNoiseFactor = 4;           // motion range over noise
constexpr double kSurfaceShare = 0.05;       // of the distance, within which a depth map shows the same surface
constexpr double kMostStatic = 0.35;         // of the frames; wrong depths lie above 0.4, right ones below 0.3
constexpr int64_t kLargestSnap = 12;         // pixels
constexpr double kFlowSupport = 5;           // pixels
constexpr double kEdge = 0.02;               // depth difference over two pixels that makes an edge, share of the depth

size_t At(int64_t i) { return static_cast<size_t>(i); }

class Examiner {
 public:
  Examiner(const Clip& clip, DirectFlows* direct, const MotionEvidence& motion, const DepthRange& range,
           const DetectionConfig& config)
      : clip_(clip), direct_(*direct), motion_(motion), range_(range), config_(config) {
    options_.skip_interval = config.skip_interval;
    options_.skip_max_error = config.skip_max_error * clip_.PixelScale();
  }

  // Empty when no frame sees the point on a surface.
  std::optional<Candidate> Examine(const VolumeMaximum& maximum, double voxel_size) {
    std::vector<TrackStart> starts = Starts(maximum.point, voxel_size);
    if (starts.empty()) return std::nullopt;
    Candidate candidate;
    candidate.maximum = maximum;
    candidate.start = ChooseStart(std::move(starts));
    candidate.pixels = Propagate(clip_, &direct_, candidate.start.frame, candidate.start.pixel, options_, &motion_);
    candidate.on_static_surface = !DropStaticDepths(&candidate.pixels);
    candidate.track = Lift(candidate.pixels);
    // What a track says of its part is read off the refined one: lifted by depth maps alone, a part's points scatter
    // along their rays while it moves.
    candidate.refined = candidate.track;
    candidate.refined.position = RefineTrack(clip_, candidate.track, candidate.pixels).position;
    candidate.motion = MeasureTrackMotion(candidate.refined);
    candidate.motion.noise = MeasureTrackMotion(candidate.track).noise;  // before smoothing
    std::vector<double> camera_motion;
    candidate.own_motion = OwnMotion(candidate, &camera_motion);
    candidate.camera_strength = UpperQuartile(std::move(camera_motion));
    candidate.moving = CountMoving(candidate.pixels);
    candidate.objection = Objection(candidate);
    return candidate;
  }

 private:
  // Frames in which the point lies on the surface, in time order, each with the surface's pixel that is to be tracked.
  std::vector<TrackStart> Starts(const Vec3& point, double voxel_size) const {
    std::vector<TrackStart> starts;
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      const Projected projected = Project(clip_.cameras[At(t)], point);
      const Pixel pixel = {projected.u, projected.v};
      if (!projected.valid || !clip_.Inside(pixel)) continue;
      const double phi = Norm(point - clip_.cameras[At(t)].position);
      // Surface points inside a voxel lie up to half its diagonal from its centre.
      const double tolerance = std::max(config_.reference_delta * phi, voxel_size);
      const std::optional<TrackStart> start = Snap(t, point, pixel, tolerance, phi);
      if (start) starts.push_back(*start);
    }
    return starts;
  }

  // The surface pixel around a projection that suits tracking best, if any lies within the tolerance. The ray through
  // the voxel's centre may just miss a part that is seen edge-on, so the surface is looked for all around; and at the
  // edge of a part flow is unreliable, so pixels up to twice as far off are taken that move and have their own surface
  // around.
  std::optional<TrackStart> Snap(int64_t t, const Vec3& point, const Pixel& pixel, double tolerance, double phi) const {
    const double pixels_per_unit = clip_.cameras[At(t)].focal_length / phi;
    const int64_t reach = std::clamp<int64_t>(std::llround(2 * tolerance * pixels_per_unit), 1, kLargestSnap);
    std::optional<TrackStart> best;
    double least = std::numeric_limits<double>::infinity(), nearest = least;
    for (int64_t dy = -reach; dy <= reach; ++dy) {
      for (int64_t dx = -reach; dx <= reach; ++dx) {
        TrackStart start = {t, {pixel.u + static_cast<double>(dx), pixel.v + static_cast<double>(dy)}, NAN, 0};
        if (!clip_.Inside(start.pixel)) continue;
        start.distance = LocalDepth(clip_.depth[At(t)], start.pixel, 0);
        if (!std::isfinite(start.distance)) continue;
        const double off = Norm(clip_.Lift(t, start.pixel, start.distance) - point) / tolerance;
        nearest = std::min(nearest, off);
        if (off > 2) continue;
        start.motion = motion_.At(t, start.pixel);
        const double cost = off + 3 * EdgeShare(start) + (start.motion < 1 ? 2 : 0);
        if (cost < least) {
          least = cost;
          best = start;
        }
      }
    }
    return nearest < 1 ? best : std::nullopt;
  }

  // Share of the surroundings, as far as dense flow mixes motions, that lies on another surface.
  double EdgeShare(const TrackStart& start) const {
    int other = 0, count = 0;
    for (const double radius : {0.5 * kFlowSupport, 1.0 * kFlowSupport}) {
      for (int i = 0; i < 8; ++i, ++count) {
        const Pixel around = {start.pixel.u + radius * std::cos(i * M_PI / 4),
                              start.pixel.v + radius * std::sin(i * M_PI / 4)};
        const double depth = LocalDepth(clip_.depth[At(start.frame)], around, 0);
        if (!(std::abs(depth - start.distance) < kEdge * radius / 2 * start.distance)) ++other;
      }
    }
    return static_cast<double>(other) / count;
  }

  TrackStart ChooseStart(std::vector<TrackStart> starts) const {
    const TrackStart first = starts.front();
    std::stable_sort(starts.begin(), starts.end(),
                     [](const TrackStart& a, const TrackStart& b) { return a.motion > b.motion; });
    const int64_t apart = std::max<int64_t>(2, clip_.num_frames() / 16);
    std::vector<TrackStart> trials;
    for (const TrackStart& start : starts) {
      if (start.motion < 1 || trials.size() == kReferenceTrials) break;
      const bool near = std::any_of(trials.begin(), trials.end(), [&](const TrackStart& other) {
        return std::abs(other.frame - start.frame) < apart;
      });
      if (!near) trials.push_back(start);
    }
    if (trials.empty()) return first;
    TrackStart best = trials.front();
    double most = -1;
    for (const TrackStart& trial : trials) {
      // A track that slipped onto the background is visible for long, but does not move.
      const PixelTrack track = Propagate(clip_, nullptr, trial.frame, trial.pixel, options_, &motion_);
      const double merit = static_cast<double>(CountMoving(track)) + 0.25 * static_cast<double>(track.CountVisible());
      if (merit > most) {
        most = merit;
        best = trial;
      }
    }
    return best;
  }

  std::vector<Pixel> OwnMotion(const Candidate& candidate, std::vector<double>* camera_motion) const {
    std::vector<Pixel> motion(At(clip_.num_frames() - 1), Pixel{NAN, NAN});
    for (int64_t t = 0; t + 1 < clip_.num_frames(); ++t) {
      if (!candidate.pixels.visible[At(t)] || !candidate.pixels.visible[At(t + 1)]) continue;
      const Pixel &now = candidate.pixels.pixel[At(t)], &next = candidate.pixels.pixel[At(t + 1)];
      const double distance = Norm(candidate.refined.position[At(t)] - clip_.cameras[At(t)].position);
      const Projected still = Project(clip_.cameras[At(t + 1)], clip_.Lift(t, now, distance));
      if (!still.valid) continue;
      motion[At(t)] = {next.u - still.u, next.v - still.v};
      camera_motion->push_back(std::hypot(still.u - now.u, still.v - now.v));
    }
    return motion;
  }

  // Takes away the depths at which the static scene lies. A pretrained field that sees a moving part at each place only
  // once may paint it onto the background (the monocular ambiguity): there the frames around see a surface that follows
  // the cameras alone, where a place that the part really takes looks disturbed. Where too few depths would be left,
  // all stay, and the answer is false.
  bool DropStaticDepths(PixelTrack* track) const {
    std::vector<double> kept = track->distance;
    int64_t left = 0;
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      double& distance = kept[At(t)];
      if (!std::isfinite(distance)) continue;
      if (StaticShare(clip_.Lift(t, track->pixel[At(t)], distance)) > kMostStatic) {
        distance = NAN;
      } else {
        ++left;
      }
    }
    if (left < kLeastVisibleFrames) return false;
    track->distance = kept;
    return true;
  }

  // Of the frames that see a surface at the point, the share in which it moves with the static scene.
  double StaticShare(const Vec3& point) const {
    int64_t still = 0, seen = 0;
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      const Projected projected = Project(clip_.cameras[At(t)], point);
      const Pixel pixel = {projected.u, projected.v};
      if (!projected.valid || !clip_.Inside(pixel)) continue;
      const double phi = Norm(point - clip_.cameras[At(t)].position);
      if (!(std::abs(LocalDepth(clip_.depth[At(t)], pixel, 0) - phi) <= kSurfaceShare * phi)) continue;
      ++seen;
      if (motion_.At(t, pixel) < 1) ++still;
    }
    return seen > 0 ? static_cast<double>(still) / static_cast<double>(seen) : 0;
  }

  int64_t CountMoving(const PixelTrack& track) const {
    int64_t moving = 0;
    for (int64_t t = 0; t < clip_.num_frames(); ++t)
      if (track.visible[At(t)] && motion_.At(t, track.pixel[At(t)]) >= 1) ++moving;
    return moving;
  }

  // 3-D positions: on the surface where there is evidence, elsewhere along the pixel's ray at a distance interpolated
  // in time (held before the first and after the last frame with evidence).
  PointTrack Lift(const PixelTrack& pixels) const {
    const int64_t frames = clip_.num_frames();
    PointTrack track;
    track.position.resize(At(frames));
    track.visible.assign(At(frames), false);
    int64_t before = -1;
    for (int64_t t = 0; t <= frames; ++t) {
      if (t < frames && !std::isfinite(pixels.distance[At(t)])) continue;
      for (int64_t s = before + 1; s < t; ++s) {
        double distance = 1;
        if (before >= 0 || t < frames) {
          const double a = pixels.distance[At(before >= 0 ? before : t)],
                       b = pixels.distance[At(t < frames ? t : before)];
          distance = a + (b - a) * static_cast<double>(s - before) / static_cast<double>(t - before);
        }
        track.position[At(s)] = clip_.Lift(s, pixels.pixel[At(s)], distance);
      }
      if (t < frames) {
        track.position[At(t)] = clip_.Lift(t, pixels.pixel[At(t)], pixels.distance[At(t)]);
        track.visible[At(t)] = !Covered(t, pixels.pixel[At(t)], pixels.distance[At(t)]);
      }
      before = t;
    }
    HoldUnseenEnds(pixels, &track);
    return track;
  }

  // Whether something nearer is in front. Flow may keep a point at the edge of what covers it, beside its own surface.
  bool Covered(int64_t t, const Pixel& pixel, double distance) const {
    return LocalDepth(clip_.depth[At(t)], pixel, 0) < distance * (1 - options_.depth_jump);
  }

  // Before the first and after the last visible frame the pixel is unknown, and the camera goes on: the scene point is
  // held, not the pixel.
  static void HoldUnseenEnds(const PixelTrack& pixels, PointTrack* track) {
    const auto first = std::find(pixels.visible.begin(), pixels.visible.end(), true) - pixels.visible.begin();
    const auto last = static_cast<int64_t>(pixels.visible.size()) - 1 -
                      (std::find(pixels.visible.rbegin(), pixels.visible.rend(), true) - pixels.visible.rbegin());
    for (int64_t t = 0; t < first; ++t) track->position[At(t)] = track->position[At(first)];
    for (int64_t t = last + 1; t < static_cast<int64_t>(pixels.visible.size()); ++t)
      track->position[At(t)] = track->position[At(last)];
  }

  std::string Objection(const Candidate& candidate) const {
    const int64_t moving = candidate.moving;
    std::vector<double> distances;
    for (const double distance : candidate.pixels.distance)
      if (std::isfinite(distance)) distances.push_back(distance);
    const int64_t seen = candidate.pixels.CountVisible();
    const double share = static_cast<double>(seen) / static_cast<double>(clip_.num_frames());
    if (seen < kLeastVisibleFrames || share < kLeastVisibleShare) {
      return fmt::format("its track is visible in {} frames only", seen);
    }
    if (moving < kLeastMovingFrames || static_cast<double>(moving) < kLeastMovingShare * static_cast<double>(seen)) {
      return fmt::format("the surface there moves against the static scene in {} of {} frames only", moving, seen);
    }
    std::vector<Sighting> sightings;
    for (int64_t t = 0; t < clip_.num_frames(); ++t)
      if (candidate.pixels.visible[At(t)]) sightings.push_back({t, candidate.pixels.pixel[At(t)]});
    const double cost = CostOfStillness(clip_, sightings, range_);
    if (cost < kLeastGain) {
      return fmt::format("a static point explains its track at a cost of {:.1f}, less than {:.1f}", cost, kLeastGain);
    }
    if (static_cast<int64_t>(distances.size()) < kLeastVisibleFrames) {
      return fmt::format("its depth is known in {} frames only", distances.size());
    }
    const double least = std::max(kLeastRange * Percentile(distances, 0.5), kNoiseFactor * candidate.motion.noise);
    if (candidate.motion.range < least) {
      return fmt::format("its track moves by {:.4f} scene units, less than {:.4f}, which noise explains",
                         candidate.motion.range, least);
    }
    return "";
  }

  const Clip& clip_;
  DirectFlows& direct_;
  const MotionEvidence& motion_;
  DepthRange range_;
  const DetectionConfig& config_;
  PropagationOptions options_;
};

}  // namespace

std::vector<Candidate> VolumeCandidates(const Clip& clip, DirectFlows* direct, const MotionEvidence& motion,
                                        const DepthRange& range, const std::vector<VolumeMaximum>& maxima,
                                        double voxel_size, const DetectionConfig& config,
                                        std::vector<std::string>* notes) {
  Examiner examiner(clip, direct, motion, range, config);
  const size_t most = kCandidatesPerKeyPoint * At(std::max(config.count, config.max_count));
  const size_t examined = std::min(maxima.size(), most);
  std::vector<Candidate> candidates;
  Progress progress("key point candidates", static_cast<double>(std::max<size_t>(examined, 1)));
  for (size_t i = 0; i < examined; ++i) {
    if (InterruptRequested()) Throw<Interrupted>("interrupted during key point detection");
    std::optional<Candidate> candidate = examiner.Examine(maxima[i], voxel_size);
    if (candidate) {
      candidates.push_back(std::move(*candidate));
    } else {
      notes->push_back(fmt::format("candidate at {} dropped: no frame sees it on a surface", Place(maxima[i].point)));
    }
    progress.Update(static_cast<double>(i + 1));
  }
  progress.Finish();
  RejectWeakMotion(&candidates, clip.PixelScale());
  RejectShadows(&candidates);
  MergeDuplicates(&candidates, config.merge_distance);
  return candidates;
}

}  // namespace editnerf
