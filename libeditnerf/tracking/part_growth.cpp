#include "libeditnerf/tracking/part_growth.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/tracking/patches.h"
#include "libeditnerf/tracking/propagation.h"

namespace editnerf {
namespace {

constexpr double kSeedRadius = 24;                // pixels at 320 wide
constexpr size_t kSeedTracks = 24;                // the nearest
constexpr size_t kLeastTracks = 6;                // around the seed
constexpr double kAdjacent = 16;                  // pixels at 320 wide, to a point of the part
constexpr int kBlock = 8;                         // frames added at each end between solutions
constexpr size_t kFirstReversal = 20;             // known frames from which the part is tried inside out
constexpr int64_t kLeastOverlap = 6;              // known frames of a track that joins
constexpr double kTurnsCost = 1.1;                // times the mean miss; drift costs turns of some degrees 1.2
constexpr double kHingeCost = 1.1;                // likewise; false ones cost 1.2
constexpr int kMostSides = 3;                     // times that other sides of what is on a hinge are looked for,
constexpr double kMoreOnOtherSides = 1.1;         // as long as they add so many pixels
constexpr double kLeastGainToJoin = 1;            // of a track, over stillness
constexpr int64_t kLookEvery = 5, kLookFrom = 5;  // lost frames looked at, and frames looked from
constexpr size_t kTried = 40, kLeastFound = 8;    // points
constexpr double kLeastFoundShare = 0.4, kFoundSimilarity = 0.75, kFoundError = 2;  // pixels at 320 wide

size_t At(int64_t t) { return static_cast<size_t>(t); }

class Growth {
 public:
  Growth(const Clip& clip, DirectFlows* direct, std::vector<FlowTrack>* tracks, std::vector<bool>* taken,
         const GrowthOptions& options)
      : clip_(clip),
        direct_(direct),
        tracks_(*tracks),
        taken_(*taken),
        options_(options),
        fit_(clip, *tracks, options.solver, options.range),
        refused_(tracks->size(), 0),
        looked_(At(clip.num_frames()), false) {}

  std::optional<RigidPart> Run(const PartSeed& seed) {
    const std::vector<size_t> near = TracksAround(seed);
    if (near.size() < kLeastTracks) return std::nullopt;
    fit_.Begin(seed, near);
    if (!GrowInTime()) return std::nullopt;
    while (direct_ && fit_.Observations() >= options_.look_again_from && LookAgain())
      if (!GrowInTime()) return std::nullopt;
    if (!fit_.SolveAtLast()) return std::nullopt;
    fit_.Settle();
    if (fit_.Simplify(PartMotion::kNoTurns, kTurnsCost)) {
      Join();
      fit_.Settle();
    } else if (fit_.Simplify(PartMotion::kHinge, kHingeCost)) {
      Join();
      for (int i = 0; i < kMostSides && JoinOtherSides();) ++i;
    }
    for (const PartPoint& point : part().points)
      for (const size_t i : point.tracks) taken_[i] = true;
    return fit_.Finished();
  }

 private:
  const RigidPart& part() const { return fit_.part(); }

  std::vector<size_t> TracksAround(const PartSeed& seed) const {
    std::vector<std::pair<double, size_t>> near;
    for (size_t i = 0; i < tracks_.size(); ++i) {
      if (taken_[i] || !tracks_[i].Covers(seed.frame)) continue;
      const double off = Distance(tracks_[i].At(seed.frame), seed.pixel);
      if (off < kSeedRadius * clip_.PixelScale()) near.emplace_back(off, i);
    }
    std::sort(near.begin(), near.end());
    if (near.size() > kSeedTracks) near.resize(kSeedTracks);
    std::vector<size_t> tracks;
    for (const auto& [off, i] : near) tracks.push_back(i);
    return tracks;
  }

  // From every frame whose pose is known into those beside it. False where the part falls apart.
  bool GrowInTime() {
    for (bool grows = true; grows;) {
      if (InterruptRequested()) Throw<Interrupted>("interrupted while moving parts were fitted");
      grows = false;
      for (int i = 0; i < kBlock; ++i) grows = GrowByAFrame() || grows;
      if (!fit_.SolveOnTheWay()) return false;
      const size_t known = SeenFrames(part()).size();
      if (known >= try_inside_out_) {
        try_inside_out_ = 2 * known;
        fit_.TryInsideOut();
      }
      Join();
    }
    return true;
  }

  bool GrowByAFrame() {
    bool grows = false;
    const std::vector<bool> seen = part().seen;
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      if (seen[At(t)]) continue;
      const bool after = t > 0 && seen[At(t - 1)], before = t + 1 < clip_.num_frames() && seen[At(t + 1)];
      if ((after && fit_.Extend(t, t - 1)) || (before && fit_.Extend(t, t + 1))) grows = true;
    }
    return grows;
  }

  // Tracks near the part's points that move as it does, where stillness would not do: while a part rests, all that lies
  // beside it moves as it does.
  void Join() {
    std::vector<bool> member(tracks_.size(), false);
    for (const PartPoint& point : part().points)
      for (const size_t i : point.tracks) member[i] = true;
    const std::vector<PartPoint> now = part().points;
    for (size_t i = 0; i < tracks_.size(); ++i) {
      if (member[i] || taken_[i]) continue;
      int64_t overlap = 0, first = -1, last = -1;
      for (int64_t t = tracks_[i].first; t < tracks_[i].end(); ++t) {
        if (!part().seen[At(t)]) continue;
        ++overlap, last = t;
        if (first < 0) first = t;
      }
      // A track that did not follow is asked again when twice as many frames can tell.
      if (overlap < std::max(kLeastOverlap, 2 * refused_[i])) continue;
      if (!Beside(now, tracks_[i], {first, (first + last) / 2, last})) continue;
      PartPoint point = {{i}, {}};
      if (!fit_.Triangulate(&point)) {
        refused_[i] = overlap;
      } else if (fit_.Gain(point) >= kLeastGainToJoin) {
        fit_.Add(point);
      }
    }
  }

  // The tracks of what the part shows where it is not seen yet. False where they add little, and the part as it was
  // where they add nothing.
  bool JoinOtherSides() {
    const RigidPart before = part();
    const auto known = static_cast<double>(fit_.Observations());
    if (!fit_.FollowFlow()) return false;
    std::fill(refused_.begin(), refused_.end(), 0);
    Join();
    const double now = fit_.KeepFollowed() ? static_cast<double>(fit_.Observations()) : 0;
    if (now <= known) fit_.GoOn(before);
    return now > kMoreOnOtherSides * known;
  }

  bool Beside(const std::vector<PartPoint>& points, const FlowTrack& track,
              std::initializer_list<int64_t> frames) const {
    for (const int64_t t : frames) {
      for (const PartPoint& point : points) {
        const FlowTrack* other = fit_.TrackIn(point, t);
        if (other && Distance(other->At(t), track.At(t)) < kAdjacent * clip_.PixelScale()) return true;
        if (other || part().motion != PartMotion::kHinge) continue;  // its hinge says where it is
        const Projected at = Project(clip_.cameras[At(t)], part().Place(t, ToVec3(point.position)));
        if (at.valid && Distance({at.u, at.v}, track.At(t)) < kAdjacent * clip_.PixelScale()) return true;
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
    for (size_t i = 0; i < part().points.size() && find.tried < kTried; ++i) {
      const FlowTrack* track = fit_.TrackIn(part().points[i], from);
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
    const std::vector<int64_t> seen = SeenFrames(part());
    const int64_t stride = std::max<int64_t>(1, static_cast<int64_t>(seen.size()) / kLookFrom);
    std::vector<Find> finds;
    for (int64_t t = 0; t < clip_.num_frames(); ++t) {
      if (part().seen[At(t)] || looked_[At(t)] || t % kLookEvery != 0) continue;
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
      if (!part().seen[At(find.to)] && TakeUp(find)) any = true;
    return any;
  }

  bool TakeUp(const Find& find) {
    const std::vector<PartPoint> before = part().points;
    const size_t count = tracks_.size();
    for (const auto& [i, pixel] : find.found) {
      if (fit_.TrackIn(part().points[i], find.to)) continue;
      fit_.AddTrack(i, tracks_.size());
      tracks_.push_back(FollowPixel(clip_, find.to, pixel));
      taken_.push_back(false);
      refused_.push_back(0);
    }
    if (fit_.Extend(find.to, find.from)) return true;
    fit_.SetPoints(before);
    tracks_.resize(count);
    taken_.resize(count);
    refused_.resize(count);
    return false;
  }

  const Clip& clip_;
  DirectFlows* direct_;
  std::vector<FlowTrack>& tracks_;
  std::vector<bool>& taken_;
  const GrowthOptions& options_;
  PartFit fit_;
  std::vector<int64_t> refused_;  // per track: frames in which it did not follow the part; 0: not asked yet
  std::vector<bool> looked_;      // T: looked for again
  size_t try_inside_out_ = kFirstReversal;
};

}  // namespace

std::optional<RigidPart> GrowPart(const Clip& clip, DirectFlows* direct, const PartSeed& seed,
                                  std::vector<FlowTrack>* tracks, std::vector<bool>* taken,
                                  const GrowthOptions& options) {
  return Growth(clip, direct, tracks, taken, options).Run(seed);
}

}  // namespace editnerf
