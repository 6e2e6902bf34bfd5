#include "libeditnerf/tracking/part_candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/median_point.h"

namespace editnerf {
namespace {

constexpr double kFarShare = 0.8;     // of the range that a tenth of the points exceeds
constexpr double kBeside = 8;         // pixels at 320 wide
constexpr double kMostBeside = 8;     // neighbours that count
constexpr double kSurrounded = 0.5;   // of the neighbours in the frame that has most
constexpr double kSameDepth = 0.05;   // share of the distance within which a neighbour is the same side of the part
constexpr double kSamePlace = 0.3;    // pixels at 320 wide: a frame that far away counts by half
constexpr double kLeastRest = 5;      // frames in one place
constexpr double kRestShare = 0.8;    // of the frames that the longest rest has
constexpr double kMiddleShare = 0.2;  // of the frames, in the middle of a way on a rail or hinge

size_t At(int64_t i) { return static_cast<size_t>(i); }

class PartView {
 public:
  PartView(const Clip& clip, const std::vector<FlowTrack>& tracks, const RigidPart& part)
      : clip_(clip), tracks_(tracks), part_(part) {}

  const PartPoint& Choose() const {
    std::vector<double> ranges;
    for (const PartPoint& point : part_.points) ranges.push_back(PointRange(part_, ToVec3(point.position)));
    std::vector<double> sorted = ranges;
    std::sort(sorted.begin(), sorted.end());
    const double least = kFarShare * sorted[sorted.size() * 9 / 10];
    size_t best = 0;
    double most = -1;
    for (size_t i = 0; i < ranges.size(); ++i) {
      if (ranges[i] < least) continue;
      const FlowTrack& longest = Longest(part_.points[i]);
      const int64_t middle = (longest.first + longest.end()) / 2;
      const double crowd = std::min(kMostBeside, Beside(middle, ToVec3(part_.points[i].position)));
      const double merit = static_cast<double>(longest.pixel.size()) * (1 + crowd);
      if (merit > most) most = merit, best = i;
    }
    return part_.points[best];
  }

  // Of the frames in which the point is well surrounded, those of the part's longest rest, if it rests: many views
  // agree on where it is, while one that moves is off by what its own view tells of its distance. On a rail or a hinge
  // all frames together tell where it is, and what is wrong with that line or axis shows at the ends of the way: those
  // in the middle of it. Of those, the one that sees the part most as all of them do. What is left of drift grows with
  // the angle between two views of the part: from its middle, it is off by half as much at most.
  int64_t ReferenceFrame(const PartPoint& point) const {
    const Vec3 position = ToVec3(point.position);
    std::vector<int64_t> frames;
    std::vector<double> crowd;
    std::vector<Vec3> view;  // unit, from the part, in its own axes
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      if (!part_.seen[At(t)]) continue;
      frames.push_back(t);
      crowd.push_back(Beside(t, position));
      view.push_back(Normalized(part_.TakeBack(t, clip_.cameras[At(t)].position) - position));
    }
    if (frames.empty()) return Longest(point).seed;
    const double enough = kSurrounded * *std::max_element(crowd.begin(), crowd.end());
    std::vector<Vec3> good_views;
    std::vector<bool> good;
    for (size_t i = 0; i < frames.size(); ++i) {
      good.push_back(crowd[i] >= enough);
      if (good[i]) good_views.push_back(view[i]);
    }
    std::vector<Vec3> place;
    for (const int64_t t : frames) place.push_back(part_.Place(t, position));
    if (part_.motion == PartMotion::kRail || part_.motion == PartMotion::kHinge) {
      KeepMiddle(place, &good);
    } else {
      KeepRest(frames, place, &good);
    }
    const Vec3 middle = MedianPoint(good_views);
    size_t best = 0;
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < frames.size(); ++i) {
      if (!good[i]) continue;
      if (const double apart = Norm(view[i] - middle); apart < nearest) nearest = apart, best = i;
    }
    return frames[best];
  }

  // Points of the part that are seen around where the point is in frame t, on the same side.
  double Beside(int64_t t, const Vec3& position) const {
    const Vec3 place = part_.Place(t, position);
    const Projected at = Project(clip_.cameras[At(t)], place);
    if (!at.valid) return 0;
    const double distance = Norm(place - clip_.cameras[At(t)].position);
    double count = 0;
    for (const PartPoint& other : part_.points) {
      for (const size_t i : other.tracks) {
        if (!tracks_[i].Covers(t)) continue;
        const double depth = Norm(part_.Place(t, ToVec3(other.position)) - clip_.cameras[At(t)].position);
        count += Distance(tracks_[i].At(t), {at.u, at.v}) < kBeside * clip_.PixelScale() &&
                 std::abs(depth / distance - 1) < kSameDepth;
        break;
      }
    }
    return count;
  }

 private:
  // Of the good ones among the frames, only those in which the point is nearest to the middle of its places.
  static void KeepMiddle(const std::vector<Vec3>& place, std::vector<bool>* good) {
    const Vec3 middle = MedianPoint(place);
    std::vector<double> apart, of_good;
    for (size_t i = 0; i < place.size(); ++i) {
      apart.push_back(Norm(place[i] - middle));
      if ((*good)[i]) of_good.push_back(apart[i]);
    }
    const double most = Percentile(std::move(of_good), kMiddleShare);
    for (size_t i = 0; i < place.size(); ++i) (*good)[i] = (*good)[i] && apart[i] <= most;
  }

  // Of the good ones among the frames, only those in which the point is where it is in most others; all, if it rests
  // nowhere.
  void KeepRest(const std::vector<int64_t>& frames, const std::vector<Vec3>& place, std::vector<bool>* good) const {
    std::vector<double> rest;
    double longest = 0;
    for (size_t i = 0; i < frames.size(); ++i) {
      const Camera& camera = clip_.cameras[At(frames[i])];
      const double pixels = camera.focal_length / clip_.PixelScale() / Norm(place[i] - camera.position);
      rest.push_back(0);
      for (const Vec3& other : place) {
        const double apart = Norm(other - place[i]) * pixels / kSamePlace;
        rest.back() += 1 / (1 + apart * apart);
      }
      if ((*good)[i]) longest = std::max(longest, rest.back());
    }
    if (longest < kLeastRest) return;
    for (size_t i = 0; i < frames.size(); ++i) (*good)[i] = (*good)[i] && rest[i] >= kRestShare * longest;
  }

  const FlowTrack& Longest(const PartPoint& point) const {
    const auto longest = std::max_element(point.tracks.begin(), point.tracks.end(), [&](size_t a, size_t b) {
      return tracks_[a].pixel.size() < tracks_[b].pixel.size();
    });
    return tracks_[*longest];
  }

  const Clip& clip_;
  const std::vector<FlowTrack>& tracks_;
  const RigidPart& part_;
};

Candidate ToCandidate(const Clip& clip, const MovingParts& moving, const MovingPart& part) {
  const PartView view(clip, moving.tracks, part.body);
  const PartPoint& point = view.Choose();
  const Vec3 position = ToVec3(point.position);
  const int64_t frames = clip.num_frames(), reference = view.ReferenceFrame(point);
  Candidate candidate;
  if (part.body.turns()) candidate.turns = TurnsOf(part.body);
  candidate.maximum.value = part.weight;
  candidate.maximum.point = part.body.Place(reference, position);
  candidate.pixels.reference_frame = reference;
  for (int64_t t = 0; t < frames; ++t) {
    const Vec3 place = part.body.Place(t, position);
    const Projected at = Project(clip.cameras[At(t)], place);
    const Pixel pixel = {at.u, at.v};
    const bool visible = part.body.seen[At(t)] && at.valid && clip.Inside(pixel) && view.Beside(t, position) > 0;
    candidate.pixels.pixel.push_back(pixel);
    candidate.pixels.visible.push_back(visible);
    candidate.pixels.distance.push_back(visible ? Norm(place - clip.cameras[At(t)].position) : NAN);
    candidate.track.position.push_back(place);
    candidate.track.visible.push_back(visible);
  }
  candidate.pixels.visible[At(reference)] = candidate.track.visible[At(reference)] = true;
  candidate.start = {reference, candidate.pixels.pixel[At(reference)],
                     Norm(candidate.maximum.point - clip.cameras[At(reference)].position), 1};
  candidate.refined = candidate.track;
  candidate.motion = MeasureTrackMotion(candidate.track);
  candidate.moving = candidate.pixels.CountVisible();
  return candidate;
}

}  // namespace

std::vector<Candidate> PartCandidates(const Clip& clip, const MovingParts& moving) {
  std::vector<Candidate> candidates;
  for (const MovingPart& part : moving.parts) {
    candidates.push_back(ToCandidate(clip, moving, part));
    candidates.back().part = static_cast<int64_t>(candidates.size()) - 1;
  }
  return candidates;
}

}  // namespace editnerf
