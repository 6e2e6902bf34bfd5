#include "libeditnerf/tracking/flow_tracks.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/tracking/propagation.h"
#include "libeditnerf/tracking/still_points.h"

namespace editnerf {
namespace {

constexpr double kLeastEvidence = 1.5;    // times the frame's threshold: away from the part's edge
constexpr int64_t kSeedInterval = 2;      // frames
constexpr size_t kShortest = 6;           // frames
static const double kLeastSimilarity = getenv("SIM") ? atof(getenv("SIM")) : 0.7;  // of the surroundings, kLag frames apart
static const double kSame = getenv("SAME") ? atof(getenv("SAME")) : 0.8; static const size_t kSameFrames = getenv("SAMEN") ? atof(getenv("SAMEN")) : 6;
static const size_t kLag = getenv("LAG") ? atoi(getenv("LAG")) : 3;
constexpr double kLeastVariance = 1;  // grey levels squared: below it there is only noise
constexpr double kStillMiss = 2.0;   // pixels at 320 wide
constexpr double kStillShare = 0.85;  // of the frames
constexpr int kStillTrials = 60;

size_t At(int64_t i) { return static_cast<size_t>(i); }

float GreyAt(const torch::Tensor& gray, const Pixel& p) {
  const int64_t width = gray.size(1), height = gray.size(0);
  const double u = std::clamp(p.u - 0.5, 0.0, static_cast<double>(width) - 1.001);
  const double v = std::clamp(p.v - 0.5, 0.0, static_cast<double>(height) - 1.001);
  const auto column = static_cast<int64_t>(u), row = static_cast<int64_t>(v);
  const auto fu = static_cast<float>(u - static_cast<double>(column)), fv = static_cast<float>(v - static_cast<double>(row));
  const float* at = gray.data_ptr<float>() + row * width + column;
  return (1 - fv) * ((1 - fu) * at[0] + fu * at[1]) + fv * ((1 - fu) * at[width] + fu * at[width + 1]);
}

// The surroundings of a pixel, carried along by the flow: they may turn and shrink, but look the same.
class Surroundings {
 public:
  Surroundings(const Clip& clip, int64_t t, const Pixel& center) : clip_(clip) {
    const int64_t radius = PatchRadius(clip);
    for (int64_t dv = -radius; dv <= radius; ++dv)
      for (int64_t du = -radius; du <= radius; ++du)
        pixels_.push_back({center.u + static_cast<double>(du), center.v + static_cast<double>(dv)});
    for (const Pixel& p : pixels_) before_.push_back(GreyAt(clip.gray[At(t)], p));
  }

  void Carry(int64_t t, int64_t step) {
    for (Pixel& p : pixels_) {
      const FlowSample flow = clip_.Step(t, step, p);
      if (flow.valid) p = {p.u + flow.du, p.v + flow.dv};
    }
  }

  // Normalised correlation of what they were and what they are in frame t.
  double Similarity(int64_t t) const {
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    const auto count = static_cast<double>(pixels_.size());
    for (size_t i = 0; i < pixels_.size(); ++i) {
      const double x = before_[i], y = GreyAt(clip_.gray[At(t)], pixels_[i]);
      a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
    }
    const double variance_a = aa / count - a * a / (count * count), variance_b = bb / count - b * b / (count * count);
    if (variance_a < kLeastVariance || variance_b < kLeastVariance) return 0;
    return (ab / count - a * b / (count * count)) / std::sqrt(variance_a * variance_b);
  }

 private:
  const Clip& clip_;
  std::vector<Pixel> pixels_;
  std::vector<double> before_;
};

// For how many frames the pixel looks the same where it lies, unturned: the background that flow drags along at the edge
// of a part does not.
size_t LooksTheSame(const Clip& clip, int64_t seed, const std::vector<Pixel>& way, const Pixel& start, int64_t step) {
  std::vector<Pixel> all = {start};
  all.insert(all.end(), way.begin(), way.end());
  size_t n = 0;
  for (size_t i = 1; i < all.size(); ++i, ++n) {
    const size_t lag = std::min<size_t>(3, i);
    const int64_t now = seed + step * static_cast<int64_t>(i), before = now - step * static_cast<int64_t>(lag);
    if (PatchSimilarity(clip.gray[At(before)], all[i - lag], clip.gray[At(now)], all[i], PatchRadius(clip)) < kSame) break;
  }
  return n;
}

// The pixels after `start`, in the order of `step`.
std::vector<Pixel> FollowOneWay(const Clip& clip, int64_t seed, const Pixel& start, int64_t step) {
  std::vector<Pixel> way;
  std::deque<Surroundings> around;  // as they were in the last frames
  Pixel here = start;
  for (int64_t t = seed;; t += step) {
    const FlowSample flow = clip.Step(t, step, here);
    if (!flow.checked) break;
    around.emplace_back(clip, t, here);
    if (around.size() > kLag) around.pop_front();
    for (Surroundings& some : around) some.Carry(t, step);
    here = {here.u + flow.du, here.v + flow.dv};
    if (!clip.Inside(here) || around.front().Similarity(t + step) < kLeastSimilarity) break;
    way.push_back(here);
  }
  return way;
}

// Whether one static point explains most of the track. Parts rest at times, and tracks slip.
bool StandsStill(const Clip& clip, const FlowTrack& track, double near, double far) {
  const double most = kStillMiss * clip.PixelScale();
  for (int i = 0; i < kStillTrials; ++i) {
    const double distance = 1 / (1 / far + (1 / near - 1 / far) * i / (kStillTrials - 1));
    const Vec3 point = clip.Lift(track.seed, track.At(track.seed), distance);
    size_t still = 0;
    for (int64_t t = track.first; t < track.end(); ++t) {
      const Projected at = Project(clip.cameras[At(t)], point);
      still += at.valid && Distance({at.u, at.v}, track.At(t)) < most;
    }
    if (static_cast<double>(still) > kStillShare * static_cast<double>(track.pixel.size())) return true;
  }
  return false;
}

// Which cells of which frames a track passes through.
class PassedCells {
 public:
  PassedCells(const Clip& clip, int64_t cell)
      : cell_(cell), rows_(clip.height / cell + 1), columns_(clip.width / cell + 1) {
    cells_.assign(At(clip.num_frames() * rows_ * columns_), false);
  }
  std::vector<bool>::reference operator()(int64_t t, const Pixel& p) {
    const int64_t row = static_cast<int64_t>(p.v) / cell_, column = static_cast<int64_t>(p.u) / cell_;
    return cells_[At((t * rows_ + row) * columns_ + column)];
  }

 private:
  int64_t cell_, rows_, columns_;
  std::vector<bool> cells_;
};

}  // namespace

FlowTrack FollowPixel(const Clip& clip, int64_t seed, const Pixel& start) {
  FlowTrack track;
  track.seed = seed;
  track.pixel = FollowOneWay(clip, seed, start, -1);
  track.first = seed - static_cast<int64_t>(track.pixel.size());
  std::reverse(track.pixel.begin(), track.pixel.end());
  track.pixel.push_back(start);
  const std::vector<Pixel> after = FollowOneWay(clip, seed, start, 1);
  std::vector<Pixel> back(track.pixel.rbegin() + 1, track.pixel.rend());
  if (LooksTheSame(clip, seed, back, start, -1) + LooksTheSame(clip, seed, after, start, 1) < kSameFrames) { track.pixel = {start}; track.first = seed; return track; }
  track.pixel.insert(track.pixel.end(), after.begin(), after.end());
  return track;
}

std::vector<FlowTrack> TrackMovingPixels(const Clip& clip, const MotionEvidence& motion, double near, double far) {
  std::vector<FlowTrack> tracks;
  PassedCells passed(clip, 2 * motion.cell);
  const int64_t cells = motion.ratio.size(1) * motion.ratio.size(2), columns = motion.ratio.size(2);
  const double half = static_cast<double>(motion.cell) / 2;
  for (int64_t t = 0; t < clip.num_frames(); t += kSeedInterval) {
    if (InterruptRequested()) Throw<Interrupted>("interrupted while moving pixels were followed");
    for (int64_t i = 0; i < cells; ++i) {
      const Pixel start = {static_cast<double>(i % columns * motion.cell) + half,
                           static_cast<double>(i / columns * motion.cell) + half};
      if (!clip.Inside(start) || passed(t, start) || motion.At(t, start) < kLeastEvidence) continue;
      FlowTrack track = FollowPixel(clip, t, start);
      if (track.pixel.size() < kShortest) continue;
      for (int64_t s = track.first; s < track.end(); ++s) passed(s, track.At(s)) = true;
      tracks.push_back(std::move(track));
    }
  }
  std::vector<char> still(tracks.size());
  ParallelFor(static_cast<int64_t>(tracks.size()), 16, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) still[At(i)] = StandsStill(clip, tracks[At(i)], near, far);
  });
  std::vector<FlowTrack> moving;
  for (size_t i = 0; i < tracks.size(); ++i)
    if (!still[i]) moving.push_back(std::move(tracks[i]));
  return moving;
}

}  // namespace editnerf
