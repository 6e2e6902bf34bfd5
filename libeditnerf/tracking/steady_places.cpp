#include "libeditnerf/tracking/steady_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"

namespace editnerf {
namespace {

constexpr double kBeside = 8;    // pixels at 320 wide, to each side: parts are known every six pixels
constexpr double kAsFar = 0.03;  // share of the distance
constexpr int64_t kFramesLookedAt = 40;
constexpr double kLeastFrames = 0.075;  // share of these
constexpr double kSameHue = 0.05;       // largest difference of a colour's logarithm from the mean of the three
constexpr double kOtherLight = 0.1;     // that mean itself, likewise
constexpr double kDarkest = 4;          // of 255, added to both colours
constexpr int64_t kReach = 2;           // of a patch, pixels
constexpr int64_t kGrain = 256;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

using LogColor = std::array<double, 3>;

// Of the patch around a pixel that lies kReach or more from the border.
LogColor ColorAround(const torch::Tensor& image, int64_t column, int64_t row) {
  const int64_t width = image.size(1);
  const uint8_t* const pixels = image.data_ptr<uint8_t>();
  std::array<int64_t, 3> sum = {};
  for (int64_t y = row - kReach; y <= row + kReach; ++y) {
    const uint8_t* at = pixels + 3 * (y * width + column - kReach);
    for (int64_t x = 0; x <= 2 * kReach; ++x, at += 3)
      for (size_t c = 0; c < 3; ++c) sum[c] += at[c];
  }
  constexpr double kPixels = (2 * kReach + 1) * (2 * kReach + 1);
  LogColor color;
  for (size_t c = 0; c < 3; ++c) color[c] = std::log(static_cast<double>(sum[c]) / kPixels + kDarkest);
  return color;
}

bool HasPatch(const Clip& clip, double column, double row) {
  return column >= kReach && row >= kReach && column < static_cast<double>(clip.width - kReach) &&
         row < static_cast<double>(clip.height - kReach);
}

// The logarithm of how much lighter the patch at a place is than it was, NaN where it has another hue.
float Lighter(const LogColor& was, const LogColor& is) {
  const LogColor by = {is[0] - was[0], is[1] - was[1], is[2] - was[2]};
  const double mean = (by[0] + by[1] + by[2]) / 3;
  const bool same_hue = std::all_of(by.begin(), by.end(), [&](double b) { return std::abs(b - mean) < kSameHue; });
  return same_hue ? static_cast<float>(mean) : kUnknown;
}

class KnownPlaces {
 public:
  explicit KnownPlaces(const DepthTargets& places)
      : count_(places.size()),
        frame_(places.frame.data_ptr<int64_t>()),
        pixel_(places.pixel.data_ptr<int64_t>()),
        distance_(places.distance.data_ptr<float>()) {}

  int64_t size() const { return count_; }
  int64_t frame(int64_t i) const { return frame_[i]; }
  int64_t column(int64_t i) const { return pixel_[2 * i]; }
  int64_t row(int64_t i) const { return pixel_[2 * i + 1]; }
  double distance(int64_t i) const { return static_cast<double>(distance_[i]); }

  // The places of each frame.
  std::vector<std::vector<int64_t>> ByFrame(int64_t frames) const {
    std::vector<std::vector<int64_t>> of_frame(static_cast<size_t>(frames));
    for (int64_t i = 0; i < count_; ++i) of_frame[static_cast<size_t>(frame_[i])].push_back(i);
    return of_frame;
  }

 private:
  int64_t count_;
  const int64_t *frame_, *pixel_;
  const float* distance_;
};

void FindOnParts(const Clip& clip, const DepthTargets& parts, const KnownPlaces& still, std::vector<char>* unsteady) {
  if (parts.size() == 0) return;
  const KnownPlaces known(parts);
  const auto of_frame = known.ByFrame(clip.num_frames());
  const auto beside = static_cast<int64_t>(std::ceil(kBeside * clip.PixelScale()));
  ParallelFor(still.size(), kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const auto& there = of_frame[static_cast<size_t>(still.frame(i))];
      (*unsteady)[static_cast<size_t>(i)] = std::any_of(there.begin(), there.end(), [&](int64_t p) {
        return std::abs(known.column(p) - still.column(i)) <= beside &&
               std::abs(known.row(p) - still.row(i)) <= beside &&
               std::abs(known.distance(p) / still.distance(i) - 1) < kAsFar;
      });
    }
  });
}

// How much lighter each place is in each of some frames: [places, looks], NaN where that is not known.
std::vector<float> LightOf(const Clip& clip, const KnownPlaces& still, const std::vector<int64_t>& frames) {
  const auto looks = static_cast<int64_t>(frames.size());
  std::vector<float> light(static_cast<size_t>(still.size() * looks), kUnknown);
  ParallelFor(still.size(), kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int64_t t = still.frame(i), column = still.column(i), row = still.row(i);
      if (!HasPatch(clip, static_cast<double>(column), static_cast<double>(row))) continue;
      const LogColor was = ColorAround(clip.images[static_cast<size_t>(t)], column, row);
      const Vec3 place =
          clip.Lift(t, {static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5}, still.distance(i));
      for (int64_t look = 0; look < looks; ++look) {
        const auto frame = static_cast<size_t>(frames[static_cast<size_t>(look)]);
        const Projected there = Project(clip.cameras[frame], place);
        if (!there.valid || !HasPatch(clip, there.u, there.v)) continue;
        light[static_cast<size_t>(i * looks + look)] =
            Lighter(was, ColorAround(clip.images[frame], static_cast<int64_t>(there.u), static_cast<int64_t>(there.v)));
      }
    }
  });
  return light;
}

void FindOtherLight(const Clip& clip, const KnownPlaces& still, std::vector<char>* unsteady) {
  std::vector<int64_t> frames;
  const int64_t step = std::max<int64_t>(1, clip.num_frames() / kFramesLookedAt);
  for (int64_t t = 0; t < clip.num_frames(); t += step) frames.push_back(t);
  const size_t looks = frames.size();
  const auto least = static_cast<int64_t>(std::ceil(kLeastFrames * static_cast<double>(looks)));
  const std::vector<float> light = LightOf(clip, still, frames);
  std::vector<float> usual(looks);  // of the whole frame, as exposed
  for (size_t look = 0; look < looks; ++look) {
    std::vector<double> seen;
    for (size_t at = look; at < light.size(); at += looks)
      if (!std::isnan(light[at])) seen.push_back(static_cast<double>(light[at]));
    usual[look] = static_cast<float>(Percentile(std::move(seen), 0.5));
  }
  for (size_t i = 0; i < unsteady->size(); ++i) {
    int64_t other = 0;
    for (size_t look = 0; look < looks; ++look) {
      if (std::abs(light[i * looks + look] - usual[look]) > static_cast<float>(kOtherLight)) ++other;
    }
    if (other >= least) (*unsteady)[i] = 1;
  }
}

}  // namespace

int64_t MarkUnsteadyPlaces(const Clip& clip, const DepthTargets& parts, DepthTargets* still) {
  if (still->size() == 0) return 0;
  const KnownPlaces places(*still);
  std::vector<char> unsteady(static_cast<size_t>(places.size()), 0);
  FindOnParts(clip, parts, places, &unsteady);
  FindOtherLight(clip, places, &unsteady);
  still->key_point = still->key_point.clone();
  int64_t* const key_point = still->key_point.data_ptr<int64_t>();
  int64_t marked = 0;
  for (int64_t i = 0; i < places.size(); ++i) {
    if (unsteady[static_cast<size_t>(i)] == 0 || key_point[i] != kStandsStill) continue;
    key_point[i] = kNotCarried;
    ++marked;
  }
  return marked;
}

}  // namespace editnerf
