#include "libeditnerf/tracking/place_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"

namespace editnerf {
namespace {

constexpr int64_t kFramesLookedAt = 40;
// Largest difference of a colour's logarithm from the mean of the three; in the shade light comes from elsewhere, and
// has another hue the more of the lamp's is missing.
constexpr double kSameHue = 0.05, kHueOfShade = 0.1;
constexpr double kDarkest = 4;    // of 255, added to both colours
constexpr double kBefore = 0.97;  // share of the distance, within which something stands before a place
constexpr int64_t kReach = 2;     // of a patch, pixels
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

// Whether no pixel of the patch shows something that is nearer than that. Where depth is not known, nothing is said.
bool NothingBefore(const torch::Tensor& depth, int64_t column, int64_t row, double distance) {
  const int64_t width = depth.size(1);
  const float* const distances = depth.data_ptr<float>();
  for (int64_t y = row - kReach; y <= row + kReach; ++y) {
    for (int64_t x = column - kReach; x <= column + kReach; ++x) {
      if (static_cast<double>(distances[y * width + x]) < kBefore * distance) return false;
    }
  }
  return true;
}

// The logarithm of how much lighter the patch at a place is than it was, NaN where it has another hue.
float Lighter(const LogColor& was, const LogColor& is) {
  const LogColor by = {is[0] - was[0], is[1] - was[1], is[2] - was[2]};
  const double mean = (by[0] + by[1] + by[2]) / 3;
  const bool same_hue = std::all_of(
      by.begin(), by.end(), [&](double b) { return std::abs(b - mean) < kSameHue + kHueOfShade * std::abs(mean); });
  return same_hue ? static_cast<float>(mean) : kUnknown;
}

}  // namespace

std::vector<int64_t> FramesLookedAt(const Clip& clip) {
  std::vector<int64_t> frames;
  const int64_t step = std::max<int64_t>(1, clip.num_frames() / kFramesLookedAt);
  for (int64_t t = 0; t < clip.num_frames(); t += step) frames.push_back(t);
  return frames;
}

std::vector<float> LightOfPlaces(const Clip& clip, const DepthTargets& places, const std::vector<int64_t>& frames) {
  const int64_t count = places.size();
  const size_t looks = frames.size();
  std::vector<float> light(static_cast<size_t>(count) * looks, kUnknown);
  if (count == 0) return light;
  const int64_t *const frame = places.frame.data_ptr<int64_t>(), *const pixel = places.pixel.data_ptr<int64_t>();
  const float* const distance = places.distance.data_ptr<float>();
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int64_t column = pixel[2 * i], row = pixel[2 * i + 1];
      if (!HasPatch(clip, static_cast<double>(column), static_cast<double>(row))) continue;
      const LogColor was = ColorAround(clip.images[static_cast<size_t>(frame[i])], column, row);
      const Vec3 place = clip.Lift(frame[i], {static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5},
                                   static_cast<double>(distance[i]));
      for (size_t look = 0; look < looks; ++look) {
        const auto at = static_cast<size_t>(frames[look]);
        const Projected there = Project(clip.cameras[at], place);
        if (!there.valid || !HasPatch(clip, there.u, there.v)) continue;
        const auto x = static_cast<int64_t>(there.u), y = static_cast<int64_t>(there.v);
        if (!NothingBefore(clip.depth[at], x, y, Norm(place - clip.cameras[at].position))) continue;
        light[static_cast<size_t>(i) * looks + look] = Lighter(was, ColorAround(clip.images[at], x, y));
      }
    }
  });
  for (size_t look = 0; look < looks; ++look) {
    std::vector<double> seen;
    for (size_t at = look; at < light.size(); at += looks)
      if (!std::isnan(light[at])) seen.push_back(static_cast<double>(light[at]));
    if (seen.empty()) continue;
    const auto usual = static_cast<float>(Percentile(std::move(seen), 0.5));
    for (size_t at = look; at < light.size(); at += looks) light[at] -= usual;
  }
  return light;
}

}  // namespace editnerf
