#include "libeditnerf/tracking/steady_places.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/tracking/place_light.h"

namespace editnerf {
namespace {

constexpr double kBeside = 8;          // pixels at 320 wide, to each side: parts are known every six pixels
constexpr double kAsFar = 0.03;        // share of the distance
constexpr double kLeastShare = 0.075;  // of the frames in which a place is seen
constexpr int64_t kLeastFrames = 2;
constexpr double kMuchLight = 0.1;  // logarithm of how much lighter or darker
constexpr int64_t kGrain = 256;

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

void FindOtherLight(const Clip& clip, const DepthTargets& still, std::vector<char>* unsteady) {
  const std::vector<int64_t> frames = FramesLookedAt(clip);
  const size_t looks = frames.size();
  const std::vector<float> light = LightOfPlaces(clip, still, frames);
  for (size_t i = 0; i < unsteady->size(); ++i) {
    const auto own = light.begin() + static_cast<std::ptrdiff_t>(i * looks),
               end = own + static_cast<std::ptrdiff_t>(looks);
    const auto seen = std::count_if(own, end, [](float by) { return !std::isnan(by); });
    const auto other = std::count_if(own, end, [](float by) { return std::abs(by) > static_cast<float>(kMuchLight); });
    const auto least = static_cast<int64_t>(std::ceil(kLeastShare * static_cast<double>(seen)));
    (*unsteady)[i] = static_cast<char>(other >= std::max(kLeastFrames, least));
  }
}

}  // namespace

int64_t MarkUnsteadyPlaces(const Clip& clip, const DepthTargets& parts, DepthTargets* still) {
  if (still->size() == 0) return 0;
  const KnownPlaces places(*still);
  const auto count = static_cast<size_t>(places.size());
  std::vector<char> on_part(count, 0), in_other_light(count, 0);
  FindOnParts(clip, parts, places, &on_part);
  FindOtherLight(clip, *still, &in_other_light);
  still->key_point = still->key_point.clone();
  int64_t* const key_point = still->key_point.data_ptr<int64_t>();
  int64_t marked = 0;
  for (size_t i = 0; i < count; ++i) {
    if ((on_part[i] == 0 && in_other_light[i] == 0) || key_point[i] != kStandsStill) continue;
    key_point[i] = on_part[i] != 0 ? kNotCarried : kOtherLight;
    ++marked;
  }
  return marked;
}

}  // namespace editnerf
