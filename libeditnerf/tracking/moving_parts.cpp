#include "libeditnerf/tracking/moving_parts.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/tracking/part_gain.h"
#include "libeditnerf/tracking/part_motion.h"
#include "libeditnerf/tracking/part_seeds.h"
#include "libeditnerf/tracking/stillness.h"

namespace editnerf {
namespace {

constexpr int kMostSeeds = 16;
constexpr int kMostInVain = 8;        // seeds in a row that give nothing that weighs; flaps come late
constexpr double kLeastWeight = 0.1;  // of the heaviest part's; a small part beside a large one has a fifth
constexpr double kLeastMotion = 2;    // pixels at 320 wide, over a few frames, that tell what moves as what
constexpr double kSameMotion = 0.4;   // share of it by which the other's may differ
constexpr double kSameShare = 0.5;    // of the places that move: pieces of one part lie at 0.65 to 0.95, parts of
                                      // their own below 0.1, or 0.35 where both go about beside each other
constexpr double kAlignedGain = 1;    // over stillness; shadows and slips are left with 0 to 0.9, parts with 2 to 14
constexpr double kSurround = 20;      // pixels at 320 wide within which a pixel must be surrounded by its part
constexpr double kWidestGap = 2.6;    // radians without a neighbour
constexpr double kSlack = 2.5;        // pixels at 320 wide between a part's point and its track
constexpr float kTolerance = 0.01F;   // share of the distance

size_t At(int64_t i) { return static_cast<size_t>(i); }

// Every few points, so that a part of a thousand costs what one of forty does.
std::vector<Vec3> SomePoints(const RigidPart& part) {
  constexpr size_t kCount = 40;
  const size_t stride = std::max<size_t>(1, part.points.size() / kCount);
  std::vector<Vec3> points;
  for (size_t i = 0; i < part.points.size(); i += stride) points.push_back(ToVec3(part.points[i].position));
  return points;
}

double RangePixels(const Clip& clip, const RigidPart& part) {
  std::vector<double> ranges;
  for (const Vec3& point : SomePoints(part)) ranges.push_back(PointRange(part, point));
  return Percentile(std::move(ranges), 0.5) / PixelAt(clip, DistanceOf(clip, part));
}

MovingPart Weighed(const Clip& clip, const std::vector<FlowTrack>& tracks, RigidPart body, const DepthRange& range) {
  MovingPart part;
  part.range = RangePixels(clip, body);
  const PartGain gain = GainOverStillness(clip, tracks, body, range);
  part.gain = gain.all;
  const double share = gain.moving / kMostCost;
  if (gain.moving >= kLeastGain) part.weight = gain.all * share * share;
  part.body = std::move(body);
  return part;
}

// Empty where nothing grows.
std::optional<MovingPart> Grown(const Clip& clip, DirectFlows* direct, const PartSeed& seed,
                                const GrowthOptions& options, std::vector<FlowTrack>* tracks,
                                std::vector<bool>* taken) {
  std::optional<RigidPart> body = GrowPart(clip, direct, seed, tracks, taken, options);
  if (!body) return std::nullopt;
  MovingPart part = Weighed(clip, *tracks, std::move(*body), options.range);
  LogDebug(
      "moving parts: {} points, {} pixels in {} frames, goes {:.0f} pixels at 320 wide {}; gain {:.0f}, weight {:.0f}",
      part.body.points.size(), part.body.observations, SeenFrames(part.body).size(), part.range,
      NameOf(part.body.motion), part.gain, part.weight);
  return part;
}

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

// Over its aligned track: where looks say that it stands still there never was a part.
bool StillMoves(const Clip& clip, const std::vector<FlowTrack>& tracks, const MovingPart& part,
                const DepthRange& range) {
  const double gain = GainOverStillness(clip, tracks, part.body, range).moving;
  LogDebug("moving parts: aligned, one pixel gains {:.2f} over stillness", gain);
  return gain >= kAlignedGain;
}

void KeepHeavy(double least, std::vector<MovingPart>* parts) {
  const auto light = [least](const MovingPart& part) { return part.weight < least; };
  parts->erase(std::remove_if(parts->begin(), parts->end(), light), parts->end());
}

// Of parts in the order of their weight those that move as no heavier one.
void KeepOwn(const Clip& clip, const std::vector<FlowTrack>& tracks, std::vector<MovingPart>* parts) {
  std::vector<MovingPart> own;
  for (MovingPart& part : *parts) {
    const bool again = std::any_of(own.begin(), own.end(), [&](const MovingPart& heavier) {
      return MovesAs(clip, tracks, part.body, heavier.body);
    });
    if (!again) own.push_back(std::move(part));
  }
  *parts = std::move(own);
}

}  // namespace

bool MovesAs(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part, const RigidPart& other) {
  constexpr int64_t kLag = 3;
  int64_t moving = 0, agree = 0;
  for (const PartPoint& point : part.points) {
    for (const size_t i : point.tracks) {
      const FlowTrack& track = tracks[i];
      for (int64_t t = track.first; t + kLag < track.end(); ++t) {
        const int64_t next = t + kLag;
        if (!part.seen[At(t)] || !other.seen[At(t)] || !other.seen[At(next)]) continue;
        const Vec3& eye = clip.cameras[At(t)].position;
        const double distance = Norm(part.Place(t, ToVec3(point.position)) - eye);
        const Projected still = Project(clip.cameras[At(next)], clip.Lift(t, track.At(t), distance));
        if (!still.valid) continue;
        const double own = Distance({still.u, still.v}, track.At(next));
        if (own < kLeastMotion * clip.PixelScale()) continue;
        ++moving;
        // A piece of a part may be fitted at quite another distance.
        for (const double away : {distance, Norm(other.Place(t, other.center) - eye)}) {
          const Vec3 place = other.TakeBack(t, clip.Lift(t, track.At(t), away));
          const Projected carried = Project(clip.cameras[At(next)], other.Place(next, place));
          if (!carried.valid || Distance({carried.u, carried.v}, track.At(next)) >= kSameMotion * own) continue;
          ++agree;
          break;
        }
      }
    }
  }
  LogDebug("moving parts: moves as a heavier one in {} of {} places", agree, moving);
  return static_cast<double>(agree) > kSameShare * static_cast<double>(moving);
}

MovingParts FindMovingParts(const Clip& clip, const MotionEvidence& motion, DirectFlows* direct,
                            const DepthRange& range) {
  MovingParts found;
  found.tracks = TrackMovingPixels(clip, motion, range);
  // Tracks of fits that weigh nothing stay taken: seeds among them would give the same fit again.
  std::vector<bool> taken(found.tracks.size(), false);
  PartSeeds seeds(clip, found.tracks, range);
  double heaviest = 0;
  int in_vain = 0;
  GrowthOptions options;
  options.range = range;
  Progress progress("moving parts", kMostSeeds);
  for (int i = 0; i < kMostSeeds && in_vain < kMostInVain; ++i) {
    progress.Update(i);
    const size_t track = seeds.Next(taken);
    if (track == found.tracks.size()) break;
    PartSeed seed = {found.tracks[track].seed, found.tracks[track].At(found.tracks[track].seed), NAN};
    seed.distance = LocalDepth(clip.depth[At(seed.frame)], seed.pixel, 1);
    LogDebug("moving parts: seed in frame {} at {:.0f}, {:.0f}", seed.frame, seed.pixel.u, seed.pixel.v);
    std::optional<MovingPart> part;
    if (std::isfinite(seed.distance)) part = Grown(clip, direct, seed, options, &found.tracks, &taken);
    seeds.Spend(track, !part);
    ++in_vain;
    if (!part || !(part->weight > 0)) continue;
    if (part->weight > kLeastWeight * heaviest) in_vain = 0;
    if (part->weight > heaviest) {
      heaviest = part->weight;
      options.look_again_from = part->body.observations / 8;
    }
    found.parts.push_back(std::move(*part));
  }
  progress.Finish();
  std::stable_sort(found.parts.begin(), found.parts.end(),
                   [](const MovingPart& a, const MovingPart& b) { return a.weight > b.weight; });
  KeepHeavy(kLeastWeight * heaviest, &found.parts);
  KeepOwn(clip, found.tracks, &found.parts);
  for (MovingPart& part : found.parts) part.body = FollowByLooks(clip, part.body, range, &found.tracks);
  const auto rests = [&](const MovingPart& part) { return !StillMoves(clip, found.tracks, part, range); };
  found.parts.erase(std::remove_if(found.parts.begin(), found.parts.end(), rests), found.parts.end());
  // Once it does not drift, a part knows better what moves as it does.
  KeepOwn(clip, found.tracks, &found.parts);
  return found;
}

DepthTargets PartDepths(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part,
                        int64_t key_point) {
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
  targets.key_point = torch::full({count}, key_point, torch::kInt64);
  return targets;
}

}  // namespace editnerf
