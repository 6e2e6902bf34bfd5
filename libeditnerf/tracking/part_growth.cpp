#include "libeditnerf/tracking/part_growth.h"

#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/tracking/part_scale.h"
#include "libeditnerf/tracking/patches.h"
#include "libeditnerf/tracking/propagation.h"

namespace editnerf {
namespace {

constexpr double kSeedRadius = 24;  // pixels at 320 wide
constexpr size_t kSeedTracks = 24;  // the nearest
constexpr size_t kLeastPoints = 6;
constexpr double kInlier = 2.5;                      // pixels at 320 wide
constexpr double kInlierShare = 0.7;                 // of a track's pixels
constexpr double kAdjacent = 16;                     // pixels at 320 wide, to a point of the part
constexpr int kBlock = 8;                            // frames added at each end between solutions
constexpr int64_t kLeastSeen = 4;                    // points in a frame
constexpr int64_t kLeastOverlap = 6;                 // frames of a track that joins
constexpr size_t kFewPoints = 40, kMostPoints = 90;  // in a solution on the way, and in the last ones
constexpr int kFewIterations = 15;
constexpr double kNearest = 0.75, kFarthest = 1.33;  // of a point, as a share of the part's distance
constexpr int64_t kLookEvery = 5, kLookFrom = 5;     // lost frames looked at, and frames looked from
constexpr size_t kLeastFound = 8;
constexpr double kLeastFoundShare = 0.4, kFoundSimilarity = 0.75, kFoundError = 2;  // pixels at 320 wide
constexpr double kTurnsNeeded = 1.2;  // times the mean miss: what leaving out the turns may cost
constexpr double kKeptWithout = 0.9;  // of the pixels that must go on to follow the part

size_t At(int64_t t) { return static_cast<size_t>(t); }

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<int64_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

struct Placement {
  Mat3 turn;
  Vec3 center;
};

Placement PlacementOf(const RigidPose& pose, const Vec3& center) {
  Placement place;
  double columns[9];
  ceres::AngleAxisToRotationMatrix(pose.rotation.data(), columns);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) place.turn(r, c) = columns[3 * c + r];
  place.center = center + ToVec3(pose.translation);
  return place;
}

struct Share {
  int64_t agree = 0, count = 0;
  bool Enough() const { return static_cast<double>(agree) >= kInlierShare * static_cast<double>(count); }
};

class Growth {
 public:
  Growth(const Clip& clip, DirectFlows* direct, std::vector<FlowTrack>* tracks, std::vector<bool>* taken,
         const PartSolverOptions& options)
      : clip_(clip), direct_(direct), tracks_(*tracks), taken_(*taken), options_(options) {
    inlier_ = kInlier * clip.PixelScale();
  }

  std::optional<RigidPart> Run(const PartSeed& seed) {
    if (!Begin(seed) || !GrowInTime()) return std::nullopt;
    while (direct_ && Observations() >= options_.look_again_from && LookAgain())
      if (!GrowInTime()) return std::nullopt;
    if (!Solve(kMostPoints, options_.iterations)) return std::nullopt;
    Settle();
    LeaveOutTurns();
    Finish();
    return std::move(part_);
  }

 private:
  // The tracks around the seed, on a plane that faces the camera.
  bool Begin(const PartSeed& seed) {
    std::vector<std::pair<double, size_t>> near;
    for (size_t i = 0; i < tracks_.size(); ++i) {
      if (taken_[i] || !tracks_[i].Covers(seed.frame)) continue;
      const double off = Distance(tracks_[i].At(seed.frame), seed.pixel);
      if (off < kSeedRadius * clip_.PixelScale()) near.emplace_back(off, i);
    }
    if (near.size() < kLeastPoints) return false;
    std::sort(near.begin(), near.end());
    if (near.size() > kSeedTracks) near.resize(kSeedTracks);
    const size_t frames = At(clip_.num_frames());
    part_.reference = seed.frame;
    part_.pose.assign(frames, {});
    part_.seen.assign(frames, false);
    part_.seen[At(seed.frame)] = true;
    part_.center = clip_.Lift(seed.frame, seed.pixel, seed.distance);
    placement_.assign(frames, PlacementOf({}, part_.center));
    const Camera& camera = clip_.cameras[At(seed.frame)];
    const Vec3 axis = camera.orientation.Row(2);
    const double depth = Dot(part_.center - camera.position, axis);
    for (const auto& [off, i] : near) {
      const Vec3 direction = camera.DirectionThrough(tracks_[i].At(seed.frame).u, tracks_[i].At(seed.frame).v);
      part_.points.push_back({{i}, ToArray(camera.position + direction * (depth / Dot(direction, axis)))});
    }
    refused_.assign(tracks_.size(), 0);
    return true;
  }

  // From every frame whose pose is known into those beside it. False where the part falls apart.
  bool GrowInTime() {
    for (bool grows = true; grows;) {
      if (InterruptRequested()) Throw<Interrupted>("interrupted while moving parts were fitted");
      grows = false;
      for (int i = 0; i < kBlock; ++i) {
        const std::vector<bool> seen = part_.seen;
        for (int64_t t = 0; t < clip_.num_frames(); ++t) {
          if (seen[At(t)]) continue;
          if ((t > 0 && seen[At(t - 1)] && Extend(t, t - 1)) ||
              (t + 1 < clip_.num_frames() && seen[At(t + 1)] && Extend(t, t + 1))) {
            grows = true;
          }
        }
      }
      if (!Solve(kFewPoints, kFewIterations)) return false;
      Join();
    }
    return true;
  }

  // Finds frame t's pose, beginning from that of frame `from`.
  bool Extend(int64_t t, int64_t from) {
    part_.pose[At(t)] = part_.pose[At(from)];
    std::vector<double> du, dv;
    double depth = 0;
    for (const PartPoint& point : part_.points) {
      const FlowTrack* track = TrackIn(point, t);
      const Projected at = Project(clip_.cameras[At(t)], part_.Place(t, ToVec3(point.position)));
      if (!track || !at.valid) continue;
      depth += at.depth;
      du.push_back(track->At(t).u - at.u), dv.push_back(track->At(t).v - at.v);
    }
    const auto known = static_cast<int64_t>(du.size());
    if (known < kLeastSeen) return false;
    depth /= static_cast<double>(known);
    const Camera& camera = clip_.cameras[At(t)];
    const Vec3 shift = (camera.orientation.Row(0) * Median(&du) + camera.orientation.Row(1) * Median(&dv)) *
                       (depth / camera.focal_length);
    part_.pose[At(t)].translation = ToArray(ToVec3(part_.pose[At(t)].translation) + shift);
    if (!SolvePose(clip_, tracks_, options_, t, from, &part_)) return false;
    placement_[At(t)] = PlacementOf(part_.pose[At(t)], part_.center);
    int64_t agree = 0;
    for (const PartPoint& point : part_.points) {
      const FlowTrack* track = TrackIn(point, t);
      agree += track && Miss(point, *track, t) < inlier_;
    }
    part_.seen[At(t)] = agree >= kLeastSeen && 2 * agree >= known;
    return part_.seen[At(t)];
  }

  const FlowTrack* TrackIn(const PartPoint& point, int64_t t) const {
    for (const size_t i : point.tracks)
      if (tracks_[i].Covers(t)) return &tracks_[i];
    return nullptr;
  }

  // Pixels between where the part has the point and where the track goes.
  double Miss(const PartPoint& point, const FlowTrack& track, int64_t t) const {
    const Placement& place = placement_[At(t)];
    const Vec3 at = place.turn * (ToVec3(point.position) - part_.center) + place.center;
    const Projected projected = Project(clip_.cameras[At(t)], at);
    return projected.valid ? Distance({projected.u, projected.v}, track.At(t)) : INFINITY;
  }

  Share Agreement(const PartPoint& point, const FlowTrack& track) const {
    Share share;
    for (int64_t t = track.first; t < track.end(); ++t) {
      if (!part_.seen[At(t)]) continue;
      ++share.count;
      share.agree += Miss(point, track, t) < inlier_;
    }
    return share;
  }

  int64_t Observations(const PartPoint& point) const {
    int64_t sum = 0;
    for (const size_t i : point.tracks) sum += Agreement(point, tracks_[i]).agree;
    return sum;
  }

  int64_t Observations() const {
    int64_t sum = 0;
    for (const PartPoint& point : part_.points) sum += Observations(point);
    return sum;
  }

  // Mean of the misses, none counted for more than an outlier.
  double MeanMiss() const {
    double sum = 0;
    int64_t count = 0;
    for (const PartPoint& point : part_.points) {
      for (const size_t i : point.tracks) {
        for (int64_t t = tracks_[i].first; t < tracks_[i].end(); ++t) {
          if (!part_.seen[At(t)]) continue;
          sum += std::min(Miss(point, tracks_[i], t), inlier_), ++count;
        }
      }
    }
    return sum / static_cast<double>(count);
  }

  std::vector<int64_t> SeenFrames() const {
    std::vector<int64_t> frames;
    for (int64_t t = 0; t < clip_.num_frames(); ++t)
      if (part_.seen[At(t)]) frames.push_back(t);
    return frames;
  }

  // The longest tracks carry the solution; the others follow it, or leave. False where too few are left.
  bool Solve(size_t most_points, int iterations) {
    std::vector<PartPoint> rest;
    if (part_.points.size() > most_points) {
      std::stable_sort(part_.points.begin(), part_.points.end(),
                       [&](const PartPoint& a, const PartPoint& b) { return Observations(a) > Observations(b); });
      rest.assign(part_.points.begin() + static_cast<int64_t>(most_points), part_.points.end());
      part_.points.resize(most_points);
    }
    PartSolverOptions options = options_;
    options.iterations = iterations;
    SolvePart(clip_, tracks_, options, SeenFrames(), &part_);
    UpdatePlacements();
    for (PartPoint& point : rest)
      if (Triangulate(&point)) part_.points.push_back(point);
    return Prune();
  }

  void UpdatePlacements() {
    for (int64_t t = 0; t < clip_.num_frames(); ++t) placement_[At(t)] = PlacementOf(part_.pose[At(t)], part_.center);
  }

  bool Prune() {
    for (PartPoint& point : part_.points) {
      const auto leaves = [&](size_t i) { return !Agreement(point, tracks_[i]).Enough(); };
      point.tracks.erase(std::remove_if(point.tracks.begin(), point.tracks.end(), leaves), point.tracks.end());
    }
    const auto empty = [](const PartPoint& point) { return point.tracks.empty(); };
    part_.points.erase(std::remove_if(part_.points.begin(), part_.points.end(), empty), part_.points.end());
    return part_.points.size() >= kLeastPoints;
  }

  // Where on its ray a point's first track follows the part best; false where it does not.
  bool Triangulate(PartPoint* point) const {
    const FlowTrack& track = tracks_[point->tracks.front()];
    std::vector<int64_t> frames;
    for (int64_t t = track.first; t < track.end(); ++t)
      if (part_.seen[At(t)]) frames.push_back(t);
    if (static_cast<int64_t>(frames.size()) < kLeastOverlap) return false;
    const int64_t middle = frames[frames.size() / 2];
    const size_t stride = std::max<size_t>(1, frames.size() / 10);
    const Placement& place = placement_[At(middle)];
    const Camera& camera = clip_.cameras[At(middle)];
    const Vec3 ray = camera.DirectionThrough(track.At(middle).u, track.At(middle).v);
    const double around = Norm(place.center - camera.position);
    double least = INFINITY, low = kNearest, high = kFarthest;
    PartPoint trial = *point;
    for (int round = 0; round < 2; ++round) {
      constexpr int kTrials = 13;
      const double step = (high - low) / (kTrials - 1);
      double best = 1;
      for (int i = 0; i < kTrials; ++i) {
        const double share = low + step * i;
        const Vec3 at = camera.position + ray * (share * around) - place.center;
        trial.position = ToArray(place.turn.Transposed() * at + part_.center);
        double cost = 0;
        for (size_t k = 0; k < frames.size(); k += stride) cost += std::min(Miss(trial, track, frames[k]), 2 * inlier_);
        if (cost < least) least = cost, best = share, point->position = trial.position;
      }
      low = best - step, high = best + step;
    }
    return Agreement(*point, track).Enough();
  }

  // Tracks near the part's points that move as it does.
  void Join() {
    std::vector<bool> member(tracks_.size(), false);
    for (const PartPoint& point : part_.points)
      for (const size_t i : point.tracks) member[i] = true;
    const std::vector<PartPoint> now = part_.points;
    for (size_t i = 0; i < tracks_.size(); ++i) {
      if (member[i] || taken_[i]) continue;
      int64_t overlap = 0, first = -1, last = -1;
      for (int64_t t = tracks_[i].first; t < tracks_[i].end(); ++t) {
        if (!part_.seen[At(t)]) continue;
        ++overlap, last = t;
        if (first < 0) first = t;
      }
      // A track that did not follow is asked again when twice as many frames can tell.
      if (overlap < std::max(kLeastOverlap, 2 * refused_[i])) continue;
      if (!Beside(now, tracks_[i], {first, (first + last) / 2, last})) continue;
      PartPoint point = {{i}, {}};
      if (Triangulate(&point)) {
        part_.points.push_back(point);
      } else {
        refused_[i] = overlap;
      }
    }
  }

  bool Beside(const std::vector<PartPoint>& points, const FlowTrack& track,
              std::initializer_list<int64_t> frames) const {
    for (const int64_t t : frames) {
      for (const PartPoint& point : points) {
        const FlowTrack* other = TrackIn(point, t);
        if (other && Distance(other->At(t), track.At(t)) < kAdjacent * clip_.PixelScale()) return true;
      }
    }
    return false;
  }

  struct Find {
    int64_t from = 0, to = 0;
    size_t tried = 0;
    std::vector<std::pair<size_t, Pixel>> found;  // points, and where they are
  };

  Find Look(int64_t from, int64_t to) {
    Find find = {from, to, 0, {}};
    for (size_t i = 0; i < part_.points.size() && find.tried < kFewPoints; ++i) {
      const FlowTrack* track = TrackIn(part_.points[i], from);
      if (!track) continue;
      ++find.tried;
      const DirectFlows::Match match = direct_->Find(from, to, track->At(from));
      if (!match.valid || match.error > kFoundError * clip_.PixelScale() || !clip_.Inside(match.pixel)) continue;
      if (PatchSimilarity(clip_.gray[At(from)], track->At(from), clip_.gray[At(to)], match.pixel, PatchRadius(clip_)) >=
          kFoundSimilarity) {
        find.found.emplace_back(i, match.pixel);
      }
    }
    return find;
  }

  // Direct flow from frames that see the part into those in which it is lost; the best find is taken.
  bool LookAgain() {
    const std::vector<int64_t> seen = SeenFrames();
    const int64_t stride = std::max<int64_t>(1, static_cast<int64_t>(seen.size()) / kLookFrom);
    std::vector<Find> finds;
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      const bool lost = !part_.seen[At(t)] && (looked_.empty() || !looked_[At(t)]);
      if (!lost || t % kLookEvery != 0) continue;
      if (looked_.empty()) looked_.assign(At(clip_.num_frames()), false);
      Find best;
      for (size_t i = 0; i < seen.size(); i += At(stride)) {
        Find find = Look(seen[i], t);
        if (find.found.size() > best.found.size()) best = std::move(find);
      }
      looked_[At(t)] = true;
      if (best.found.size() >= kLeastFound &&
          static_cast<double>(best.found.size()) >= kLeastFoundShare * static_cast<double>(best.tried)) {
        finds.push_back(std::move(best));
      }
    }
    std::stable_sort(finds.begin(), finds.end(),
                     [](const Find& a, const Find& b) { return a.found.size() > b.found.size(); });
    bool any = false;
    for (const Find& find : finds)
      if (!part_.seen[At(find.to)] && TakeUp(find)) any = true;
    return any;
  }

  bool TakeUp(const Find& find) {
    const std::vector<PartPoint> before = part_.points;
    for (const auto& [i, pixel] : find.found) {
      if (TrackIn(part_.points[i], find.to)) continue;
      part_.points[i].tracks.push_back(tracks_.size());
      tracks_.push_back(FollowPixel(clip_, find.to, pixel));
      taken_.push_back(false);
      refused_.push_back(0);
    }
    if (Extend(find.to, find.from)) return true;
    part_.points = before;
    return false;
  }

  void Settle() {
    part_ = ScaledFromCameras(clip_, part_, ShortestWay(clip_, tracks_, part_));
    UpdatePlacements();
  }

  // A part that needs no turns has none: flow's errors would be explained by them.
  void LeaveOutTurns() {
    const RigidPart turning = part_;
    const int64_t turned = Observations();
    const double miss = MeanMiss();
    for (RigidPose& pose : part_.pose) pose.rotation = {0, 0, 0};
    options_.turns = false;
    const bool solved = Solve(kMostPoints, options_.iterations);
    if (solved && MeanMiss() < kTurnsNeeded * miss &&
        static_cast<double>(Observations()) >= kKeptWithout * static_cast<double>(turned)) {
      Join();
      Settle();
      return;
    }
    part_ = turning;
    options_.turns = true;
    UpdatePlacements();
  }

  void Finish() {
    part_.observations = Observations();
    part_.turns = options_.turns;
    for (const PartPoint& point : part_.points)
      for (const size_t i : point.tracks) taken_[i] = true;
    const std::vector<int64_t> seen = SeenFrames();
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      const auto after = std::lower_bound(seen.begin(), seen.end(), t);
      const int64_t nearest = after == seen.end()                                      ? seen.back()
                              : after == seen.begin() || *after - t < t - *(after - 1) ? *after
                                                                                       : *(after - 1);
      if (!part_.seen[At(t)]) part_.pose[At(t)] = part_.pose[At(nearest)];
    }
  }

  const Clip& clip_;
  DirectFlows* direct_;
  std::vector<FlowTrack>& tracks_;
  std::vector<bool>& taken_;
  PartSolverOptions options_;
  double inlier_ = 0;
  RigidPart part_;                    // seen: the frames whose poses are known
  std::vector<Placement> placement_;  // T, of part_.pose
  std::vector<int64_t> refused_;      // per track: frames in which it did not follow the part; 0: not asked yet
  std::vector<bool> looked_;          // T: looked for again
};

}  // namespace

std::optional<RigidPart> GrowPart(const Clip& clip, DirectFlows* direct, const PartSeed& seed,
                                  std::vector<FlowTrack>* tracks, std::vector<bool>* taken,
                                  const PartSolverOptions& options) {
  return Growth(clip, direct, tracks, taken, options).Run(seed);
}

}  // namespace editnerf
