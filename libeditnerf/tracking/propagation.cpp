#include "libeditnerf/tracking/propagation.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/patches.h"

namespace editnerf {
namespace {

constexpr double kReacquireSimilarity = 0.7;  // of the patch, to believe that a lost point was found again
constexpr double kSimilaritySlack = 0.02;
constexpr double kBlendDistance = 3.0;  // pixels at 320 wide; chains further apart are chosen from, not blended

size_t At(int64_t t) { return static_cast<size_t>(t); }

// One direction of one track.
class Walk {
 public:
  Walk(const Clip& clip, DirectFlows* direct, const MotionEvidence* motion, int64_t step,
       const PropagationOptions& options, PixelTrack* track)
      : clip_(clip), direct_(direct), motion_(motion), step_(step), options_(options), track_(*track) {}

  void Run() {
    const int64_t reference = track_.reference_frame;
    position_ = track_.pixel[At(reference)];
    Expect(reference, position_, track_.distance[At(reference)]);
    last_seen_ = anchor_ = reference;
    next_attempt_ = 2;
    for (int64_t t = reference + step_; t >= 0 && t < clip_.num_frames(); t += step_) {
      Chain(t);
      const int64_t age = std::abs(t - reference);
      if (direct_ && options_.skip_interval > 0 && age % options_.skip_interval == 0) Skip(t);
      if (lost_ && direct_) Search(t);
      track_.pixel[At(t)] = position_;
      track_.visible[At(t)] = !lost_ && unchecked_ == 0;
      if (track_.visible[At(t)]) {
        last_seen_ = t;
        next_attempt_ = 2;
      }
    }
  }

 private:
  // The surface at a position; `elsewhere` when it cannot be the point's: something nearer is in the way, or the static
  // background shows.
  double Surface(int64_t t, const Pixel& p, bool* elsewhere) const {
    const double expected = Expected(t);
    const double found = LocalDepth(clip_.depth[At(t)], p, DepthRadius(clip_), expected);
    const bool nearer = found < expected * (1 - options_.depth_jump);
    const bool farther = found > expected * (1 + options_.depth_jump);
    *elsewhere = nearer || (farther && motion_ && motion_->At(t, p) < 1);
    return found;
  }

  double Similarity(int64_t from, int64_t to, const Pixel& p) const {
    return PatchSimilarity(clip_.gray[At(from)], track_.pixel[At(from)], clip_.gray[At(to)], p, PatchRadius(clip_));
  }

  void Chain(int64_t t) {
    if (lost_) return;
    const FlowSample flow = clip_.Step(t - step_, step_, position_);
    const Pixel next = {position_.u + flow.du, position_.v + flow.dv};
    bool elsewhere = false;
    const double surface = flow.valid && clip_.Inside(next) ? Surface(t, next, &elsewhere) : NAN;
    if (!flow.valid || !clip_.Inside(next) || elsewhere) {
      lost_ = true;
      return;
    }
    const double expected = Expected(t);
    position_ = next;
    Expect(t, next, expected);  // for the time being
    if (!flow.checked) {
      if (++unchecked_ > options_.patience) lost_ = true;
      return;
    }
    // After frames without a check, only a look at the patch says whether this is still the point.
    if (unchecked_ > 0 && Similarity(last_seen_, t, next) < kReacquireSimilarity) {
      lost_ = true;
      return;
    }
    unchecked_ = 0;
    Trust(t, surface);
  }

  // Distance of the point's surface in frame t, as the last frames have it: there it lies at point_.
  double Expected(int64_t t) const { return Norm(point_ - clip_.cameras[At(t)].position); }
  void Expect(int64_t t, const Pixel& p, double distance) { point_ = clip_.Lift(t, p, distance); }

  // A surface further away than expected is one frame's failure of the depth map, unless it stays there.
  void Trust(int64_t t, double surface) {
    if (!std::isfinite(surface)) return;
    const double expected = Expected(t);
    if (!std::isfinite(expected) || std::abs(surface - expected) < options_.depth_jump * expected ||
        ++disagreements_ > options_.patience) {
      Expect(t, position_, surface);
      disagreements_ = 0;
    }
  }

  void Found(int64_t t, const Pixel& p) {
    bool elsewhere = false;
    const double expected = Expected(t), surface = Surface(t, p, &elsewhere);
    position_ = p;
    Expect(t, p, expected);
    lost_ = false;
    unchecked_ = 0;
    Trust(t, surface);
  }

  void Skip(int64_t t) {
    const int64_t reference = track_.reference_frame;
    const DirectFlows::Match match = direct_->Find(reference, t, track_.pixel[At(reference)]);
    if (!match.valid || match.error >= options_.skip_max_error || !clip_.Inside(match.pixel)) return;
    bool elsewhere = false;
    Surface(t, match.pixel, &elsewhere);
    if (elsewhere) return;
    const double similarity = Similarity(reference, t, match.pixel);
    const bool followed = !lost_ && unchecked_ == 0;
    if (similarity < (followed ? Similarity(reference, t, position_) - kSimilaritySlack : kReacquireSimilarity)) return;
    Found(t, match.pixel);
    track_.links.push_back({t, match.pixel});
    CorrectBetween(t);
    anchor_ = t;
  }

  // Frames strictly between the last anchor and t, chained back from t and blended with what chaining gave.
  void CorrectBetween(int64_t t) {
    Pixel back = position_;
    const double span = static_cast<double>(std::abs(t - anchor_));
    for (int64_t s = t - step_; s != anchor_; s -= step_) {
      const FlowSample flow = clip_.Step(s + step_, -step_, back);
      back = {back.u + flow.du, back.v + flow.dv};
      if (!flow.valid || !flow.checked || !clip_.Inside(back)) return;
      bool elsewhere = false;
      Surface(s, back, &elsewhere);
      if (elsewhere) return;
      const Pixel chained = track_.pixel[At(s)];
      const double share = static_cast<double>(std::abs(s - anchor_)) / span;
      if (track_.visible[At(s)] && Distance(chained, back) < kBlendDistance * clip_.PixelScale()) {
        track_.pixel[At(s)] = {chained.u + share * (back.u - chained.u), chained.v + share * (back.v - chained.v)};
        continue;
      }
      const double similarity = Similarity(track_.reference_frame, s, back);
      if (similarity <
          (track_.visible[At(s)] ? Similarity(track_.reference_frame, s, chained) : kReacquireSimilarity)) {
        return;
      }
      track_.pixel[At(s)] = back;
      track_.visible[At(s)] = true;
    }
  }

  void Search(int64_t t) {
    const int64_t gap = std::abs(t - last_seen_);
    if (gap < next_attempt_) return;
    next_attempt_ = gap + std::max<int64_t>(1, gap / 3);
    const DirectFlows::Match match = direct_->Find(last_seen_, t, track_.pixel[At(last_seen_)]);
    if (!match.valid || match.error >= options_.skip_max_error || !clip_.Inside(match.pixel)) return;
    bool elsewhere = false;
    Surface(t, match.pixel, &elsewhere);
    if (!elsewhere && Similarity(last_seen_, t, match.pixel) >= kReacquireSimilarity) Found(t, match.pixel);
  }

  const Clip& clip_;
  DirectFlows* direct_;
  const MotionEvidence* motion_;
  int64_t step_;
  const PropagationOptions& options_;
  PixelTrack& track_;
  Pixel position_;
  Vec3 point_;                 // where the surface is taken to be; NaN as long as no depth is known
  int64_t disagreements_ = 0;  // frames in a row whose depth was not the expected one
  int64_t unchecked_ = 0;      // frames in a row on flow without forward-backward agreement
  bool lost_ = false;
  int64_t last_seen_ = 0, anchor_ = 0, next_attempt_ = 2;
};

// Depths along the finished track; those that leave the running median of the visible frames are dropped. A frame's
// depth counts in another one as the distance of the same point from that camera.
void MeasureDistances(const Clip& clip, const PropagationOptions& options, PixelTrack* track) {
  const int64_t frames = clip.num_frames(), reference = track->reference_frame;
  const double at_reference = track->distance[At(reference)];
  std::vector<double> raw(At(frames), NAN);
  for (const int64_t step : {int64_t{1}, int64_t{-1}}) {
    Vec3 point = clip.Lift(reference, track->pixel[At(reference)], at_reference);
    for (int64_t t = reference; t >= 0 && t < frames; t += step) {
      if (!track->visible[At(t)]) continue;
      const Pixel& p = track->pixel[At(t)];
      raw[At(t)] = LocalDepth(clip.depth[At(t)], p, DepthRadius(clip), Norm(point - clip.cameras[At(t)].position));
      if (std::isfinite(raw[At(t)])) point = clip.Lift(t, p, raw[At(t)]);
    }
  }
  constexpr int64_t kWindow = 4;
  for (int64_t t = 0; t < frames; ++t) {
    const Vec3& eye = clip.cameras[At(t)].position;
    std::vector<double> near;
    for (int64_t s = std::max<int64_t>(t - kWindow, 0); s <= std::min(t + kWindow, frames - 1); ++s)
      if (std::isfinite(raw[At(s)])) near.push_back(Norm(clip.Lift(s, track->pixel[At(s)], raw[At(s)]) - eye));
    track->distance[At(t)] = NAN;
    if (near.empty() || !std::isfinite(raw[At(t)])) continue;
    const double median = Percentile(std::move(near), 0.5);
    if (std::abs(raw[At(t)] - median) < options.depth_jump * median) track->distance[At(t)] = raw[At(t)];
  }
}

void FillGaps(PixelTrack* track) {
  const auto frames = static_cast<int64_t>(track->pixel.size());
  int64_t before = -1;
  for (int64_t t = 0; t <= frames; ++t) {
    if (t < frames && !track->visible[At(t)]) continue;
    for (int64_t s = before + 1; s < t; ++s) {
      if (before < 0 || t == frames) {
        track->pixel[At(s)] = track->pixel[At(before < 0 ? t : before)];
        continue;
      }
      const Pixel a = track->pixel[At(before)], b = track->pixel[At(t)];
      const double share = static_cast<double>(s - before) / static_cast<double>(t - before);
      track->pixel[At(s)] = {a.u + share * (b.u - a.u), a.v + share * (b.v - a.v)};
    }
    before = t;
  }
}

}  // namespace

int64_t PatchRadius(const Clip& clip) { return std::max<int64_t>(3, std::llround(5 * clip.PixelScale())); }
int64_t DepthRadius(const Clip& clip) { return std::max<int64_t>(1, std::llround(2 * clip.PixelScale())); }

int64_t PixelTrack::CountVisible() const { return std::count(visible.begin(), visible.end(), true); }

PixelTrack Propagate(const Clip& clip, DirectFlows* direct, int64_t reference_frame, const Pixel& start,
                     const PropagationOptions& options, const MotionEvidence* motion) {
  if (reference_frame < 0 || reference_frame >= clip.num_frames() || !clip.Inside(start)) {
    Throw<ShapeError>("propagation: position ({}, {}) in frame {} lies outside {} frames of {} x {} pixels", start.u,
                      start.v, reference_frame, clip.num_frames(), clip.width, clip.height);
  }
  PixelTrack track;
  const size_t frames = At(clip.num_frames());
  track.reference_frame = reference_frame;
  track.pixel.assign(frames, start);
  track.visible.assign(frames, false);
  track.distance.assign(frames, NAN);
  track.visible[At(reference_frame)] = true;
  track.distance[At(reference_frame)] = LocalDepth(clip.depth[At(reference_frame)], start, DepthRadius(clip));
  Walk(clip, direct, motion, 1, options, &track).Run();
  Walk(clip, direct, motion, -1, options, &track).Run();
  MeasureDistances(clip, options, &track);
  FillGaps(&track);
  std::sort(track.links.begin(), track.links.end(), [](const auto& a, const auto& b) { return a.frame < b.frame; });
  return track;
}

}  // namespace editnerf
