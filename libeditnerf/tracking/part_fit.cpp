#include "libeditnerf/tracking/part_fit.h"

#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/even_choice.h"
#include "libeditnerf/tracking/part_alignment.h"
#include "libeditnerf/tracking/part_held.h"
#include "libeditnerf/tracking/part_reversal.h"
#include "libeditnerf/tracking/part_scale.h"
#include "libeditnerf/tracking/stillness.h"

namespace editnerf {
namespace {

constexpr size_t kLeastPoints = 6;
constexpr double kInlier = 2.5;                      // pixels at 320 wide
constexpr double kInlierShare = 0.7;                 // of a track's pixels
constexpr int64_t kLeastOverlap = 6;                 // known frames of a track that is to be triangulated
constexpr size_t kFewPoints = 40, kMostPoints = 90;  // in a solution on the way, and in the last ones
constexpr size_t kAlignedPoints = 200;               // likewise, once their tracks are exact enough to be worth it
constexpr int kFewIterations = 15;
constexpr double kNearest = 0.75, kFarthest = 1.33;  // of a point, as a share of the part's distance
constexpr double kKeptShare = 0.9;                   // of the pixels that must go on to follow the part

size_t At(int64_t t) { return static_cast<size_t>(t); }

}  // namespace

bool PartFit::Share::Enough() const { return static_cast<double>(agree) >= kInlierShare * static_cast<double>(count); }

PartFit::PartFit(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options,
                 const DepthRange& range)
    : clip_(clip), tracks_(tracks), options_(options), range_(range), inlier_(kInlier * clip.PixelScale()) {}

void PartFit::Begin(const PartSeed& seed, const std::vector<size_t>& near) {
  const size_t frames = At(clip_.num_frames());
  part_.reference = seed.frame;
  part_.pose.assign(frames, {});
  part_.seen.assign(frames, false);
  part_.seen[At(seed.frame)] = true;
  part_.center = clip_.Lift(seed.frame, seed.pixel, seed.distance);
  placement_.resize(frames);
  UpdatePlacements();
  const Camera& camera = clip_.cameras[At(seed.frame)];
  const Vec3 axis = camera.orientation.Row(2);
  const double depth = Dot(part_.center - camera.position, axis);
  for (const size_t i : near) {
    const Vec3 direction = camera.DirectionThrough(tracks_[i].At(seed.frame).u, tracks_[i].At(seed.frame).v);
    part_.points.push_back({{i}, ToArray(camera.position + direction * (depth / Dot(direction, axis)))});
  }
}

bool PartFit::Extend(int64_t t, int64_t from) {
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
  const Vec3 shift =
      (camera.orientation.Row(0) * Percentile(du, 0.5) + camera.orientation.Row(1) * Percentile(dv, 0.5)) *
      (depth / camera.focal_length);
  part_.pose[At(t)].translation = ToArray(ToVec3(part_.pose[At(t)].translation) + shift);
  if (!SolvePose(clip_, tracks_, options_, t, from, &part_)) return false;
  UpdatePlacement(t);
  int64_t agree = 0;
  for (const PartPoint& point : part_.points) {
    const FlowTrack* track = TrackIn(point, t);
    agree += track && Miss(point, *track, t) < inlier_;
  }
  part_.seen[At(t)] = agree >= kLeastSeen && 2 * agree >= known;
  return part_.seen[At(t)];
}

const FlowTrack* PartFit::TrackIn(const PartPoint& point, int64_t t) const {
  for (const size_t i : point.tracks)
    if (tracks_[i].Covers(t)) return &tracks_[i];
  return nullptr;
}

// Pixels between where the part has the point and where the track goes.
double PartFit::Miss(const PartPoint& point, const FlowTrack& track, int64_t t) const {
  const Placement& place = placement_[At(t)];
  const Vec3 at = place.turn * (ToVec3(point.position) - part_.center) + place.center;
  const Projected projected = Project(clip_.cameras[At(t)], at);
  return projected.valid ? Distance({projected.u, projected.v}, track.At(t)) : INFINITY;
}

PartFit::Share PartFit::Agreement(const PartPoint& point, const FlowTrack& track) const {
  Share share;
  for (int64_t t = track.first; t < track.end(); ++t) {
    if (!part_.seen[At(t)]) continue;
    ++share.count;
    share.agree += Miss(point, track, t) < inlier_;
  }
  return share;
}

std::vector<int> PartFit::Following(const PartPoint& point) const {
  std::vector<int> following(part_.seen.size(), 0);
  for (const size_t i : point.tracks) {
    for (int64_t t = tracks_[i].first; t < tracks_[i].end(); ++t)
      if (part_.seen[At(t)] && Miss(point, tracks_[i], t) < inlier_) ++following[At(t)];
  }
  return following;
}

int64_t PartFit::Observations() const {
  int64_t sum = 0;
  for (const PartPoint& point : part_.points)
    for (const size_t i : point.tracks) sum += Agreement(point, tracks_[i]).agree;
  return sum;
}

PartFit::Follow PartFit::Following() const {
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
  return {Observations(), sum / static_cast<double>(std::max<int64_t>(count, 1))};
}

bool PartFit::IsLike(const Follow& now, const Follow& other, double most_miss, double least_share) {
  return now.miss < most_miss * other.miss &&
         static_cast<double>(now.pixels) >= least_share * static_cast<double>(other.pixels);
}

bool PartFit::SolveOnTheWay() { return Solve(kFewPoints, kFewIterations); }
bool PartFit::SolveAtLast() { return Solve(kMostPoints, options_.iterations); }

bool PartFit::Solve(size_t most_points, int iterations) {
  const std::vector<PartPoint> rest = SetAside(most_points);
  SolvePoints(iterations);
  return TakeBack(rest);
}

// Leaves points from which every frame is known about as well, as far as there are any, and returns the others. The
// longest tracks alone would leave the frames that show another side of the part to a handful of points.
std::vector<PartPoint> PartFit::SetAside(size_t most_points) {
  if (part_.points.size() <= most_points) return {};
  std::vector<std::vector<int>> following;
  for (const PartPoint& point : part_.points) following.push_back(Following(point));
  const std::vector<bool> taken = EvenChoice(following, most_points);
  std::vector<PartPoint> points, rest;
  for (size_t i = 0; i < taken.size(); ++i) (taken[i] ? points : rest).push_back(std::move(part_.points[i]));
  part_.points = std::move(points);
  return rest;
}

std::optional<double> PartFit::SolvePoints(int iterations) {
  PartSolverOptions options = options_;
  options.iterations = iterations;
  const std::optional<double> cost = SolvePart(clip_, tracks_, options, SeenFrames(part_), &part_);
  UpdatePlacements();
  return cost;
}

// Of the points set aside those that follow; false where too few points are left.
bool PartFit::TakeBack(const std::vector<PartPoint>& rest) {
  for (PartPoint point : rest)
    if (Triangulate(&point)) part_.points.push_back(point);
  return Prune();
}

bool PartFit::TryInsideOut() {
  const std::vector<PartPoint> rest = SetAside(kFewPoints);
  const std::optional<double> cost = SolvePoints(options_.iterations);
  const RigidPart upright = part_;
  part_ = InsideOut(clip_, part_);
  UpdatePlacements();
  const std::optional<double> reversed = SolvePoints(options_.iterations);
  const bool better = cost && reversed && *reversed < *cost;
  if (!better) part_ = upright;
  UpdatePlacements();
  TakeBack(rest);
  return better;
}

void PartFit::UpdatePlacement(int64_t t) {
  double columns[9];
  ceres::AngleAxisToRotationMatrix(part_.pose[At(t)].rotation.data(), columns);
  Placement& place = placement_[At(t)];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) place.turn(r, c) = columns[3 * c + r];
  place.center = part_.center + ToVec3(part_.pose[At(t)].translation);
}

void PartFit::UpdatePlacements() {
  for (int64_t t = 0; t < clip_.num_frames(); ++t) UpdatePlacement(t);
}

bool PartFit::Prune() {
  for (PartPoint& point : part_.points) {
    const auto leaves = [&](size_t i) { return !Agreement(point, tracks_[i]).Enough(); };
    point.tracks.erase(std::remove_if(point.tracks.begin(), point.tracks.end(), leaves), point.tracks.end());
  }
  const auto empty = [](const PartPoint& point) { return point.tracks.empty(); };
  part_.points.erase(std::remove_if(part_.points.begin(), part_.points.end(), empty), part_.points.end());
  return part_.points.size() >= kLeastPoints;
}

bool PartFit::Triangulate(PartPoint* point) const {
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

double PartFit::Gain(const PartPoint& point) const {
  const FlowTrack& track = tracks_[point.tracks.front()];
  std::vector<Sighting> all;
  for (int64_t t = track.first; t < track.end(); ++t)
    if (part_.seen[At(t)]) all.push_back({t, track.At(t)});
  if (all.empty()) return 0;
  if (!std::isfinite(range_.near)) return kMostCost;
  const std::vector<Sighting> some = SomeOf(all);
  double moving = 0;
  for (const Sighting& one : some) moving += CostOf(clip_, part_.Place(one.frame, ToVec3(point.position)), one);
  return CostOfStillness(clip_, some, range_) - moving / static_cast<double>(some.size());
}

void PartFit::Settle() {
  if (IsHeld(part_.motion)) return;
  std::optional<double> rests = RestingScale(clip_, part_);
  if (!rests) {
    part_ = ScaledFromCameras(clip_, part_, ShortestWay(clip_, tracks_, part_));
    rests = RestingScale(clip_, part_);
  }
  part_ = ScaledFromCameras(clip_, part_, rests.value_or(1));
  UpdatePlacements();
}

bool PartFit::Become(PartMotion motion) {
  const RigidPart before = part_;
  bool solved = false;
  if (IsHeld(motion)) {
    const std::vector<PartPoint> rest = SetAside(kMostPoints);
    if (const std::optional<RigidPart> held = HeldBy(clip_, tracks_, options_, part_, motion)) {
      part_ = *held;
      UpdatePlacements();
      solved = TakeBack(rest);
    }
  } else {
    part_.motion = motion;
    if (!part_.turns())
      for (RigidPose& pose : part_.pose) pose.rotation = {0, 0, 0};
    solved = Solve(kMostPoints, options_.iterations);
  }
  if (solved) return true;
  part_ = before;
  UpdatePlacements();
  return false;
}

bool PartFit::Simplify(PartMotion motion, double most_miss) {
  const RigidPart before = part_;
  const Follow followed = Following();
  if (Become(motion) && IsLike(Following(), followed, most_miss, kKeptShare)) return true;
  part_ = before;
  UpdatePlacements();
  return false;
}

void PartFit::GoOn(const RigidPart& part) {
  part_ = part;
  placement_.resize(At(clip_.num_frames()));
  UpdatePlacements();
}

bool PartFit::SolveAgain() {
  if (!IsHeld(part_.motion)) return Solve(kAlignedPoints, options_.iterations);
  const std::vector<PartPoint> rest = SetAside(kAlignedPoints);
  const bool solved = SolveHeld(clip_, tracks_, options_, &part_).has_value();
  UpdatePlacements();
  return solved && TakeBack(rest);
}

bool PartFit::Align(std::vector<FlowTrack>* tracks) {
  const RigidPart before = part_;
  TakeLostBetween();
  std::vector<std::vector<FlowTrack>> aligned(part_.points.size());
  ParallelFor(static_cast<int64_t>(aligned.size()), 4, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) aligned[At(i)] = AlignPoint(clip_, tracks_, part_, part_.points[At(i)]);
  });
  for (size_t i = 0; i < aligned.size(); ++i) {
    if (aligned[i].empty()) continue;
    part_.points[i].tracks.clear();
    for (FlowTrack& track : aligned[i]) {
      part_.points[i].tracks.push_back(tracks->size());
      tracks->push_back(std::move(track));
    }
  }
  if (SolveAgain()) return true;
  part_ = before;
  UpdatePlacements();
  return false;
}

}  // namespace editnerf
