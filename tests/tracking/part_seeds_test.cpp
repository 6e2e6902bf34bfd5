// Where parts are looked for first, among exact tracks of three places: a crowd that stands still, a smaller one over
// which a shade passes, and a small part that moves so fast that its tracks soon end.
#include "libeditnerf/tracking/part_seeds.h"

#include <algorithm>
#include <cmath>

#include "tests/catch.h"
#include "tests/tracking/tracked_body.h"

using namespace editnerf;
using namespace editnerf::tracked;

namespace {

constexpr DepthRange kRange = {0.5, 3};

struct Crowd {
  size_t first = 0, end = 0;  // tracks
  bool Has(size_t track) const { return track >= first && track < end; }
};

struct Seen {
  Clip clip;
  std::vector<FlowTrack> tracks;
  Crowd still, shaded, moving;

  Seen() {
    clip.width = kWidth, clip.height = kHeight;
    for (int64_t t = 0; t < kFrames; ++t) clip.cameras.push_back(CameraAt(t));
    still = Add(40, 0, 60, {-0.3, -0.1, 0}, [](int64_t) { return Vec3{}; });
    // Flow goes to and fro over the shade's border, two pixels.
    shaded = Add(30, 0, 60, {0.25, 0.1, 0}, [](int64_t t) { return Vec3{0.006 * std::sin(0.3 * t), 0, 0}; });
    moving = Add(8, 20, 32, {0, 0, -0.1}, [](int64_t t) { return Vec3{0.01 * (t - 26), 0.004 * (t - 26), 0}; });
  }

  template <class Motion>
  Crowd Add(size_t count, int64_t first, int64_t end, const Vec3& around, const Motion& motion) {
    const size_t begin = tracks.size();
    for (size_t i = 0; i < count; ++i) {
      const auto k = static_cast<double>(i);
      const Vec3 p = around + Vec3{0.01 * std::sin(2.4 * k), 0.01 * std::cos(2.4 * k), 0};
      FlowTrack track;
      track.first = first, track.seed = (first + end) / 2;
      for (int64_t t = first; t < end; ++t) {
        const Projected at = Project(clip.cameras[static_cast<size_t>(t)], p + motion(t));
        track.pixel.push_back({at.u, at.v});
      }
      tracks.push_back(track);
    }
    return {begin, tracks.size()};
  }
};

}  // namespace

TEST_CASE("parts are looked for first where standing still explains least") {
  const Seen seen;
  std::vector<bool> taken(seen.tracks.size(), false);
  PartSeeds seeds(seen.clip, seen.tracks, kRange);
  size_t seed = seeds.Next(taken);
  CHECK(seen.moving.Has(seed));  // not the more and longer tracks of the others
  CHECK(seeds.Next(taken) == seed);
  seeds.Spend(seed, false);
  const size_t next = seeds.Next(taken);
  CHECK(seen.moving.Has(next));
  CHECK(next != seed);
  seeds.Spend(next, true);
  seed = seeds.Next(taken);
  CHECK(seen.shaded.Has(seed));
  seeds.Spend(seed, true);
  CHECK(seen.still.Has(seeds.Next(taken)));  // for want of another, though there are most of them
}

TEST_CASE("tracks that belong to a part are no seeds, nor are those that came later") {
  Seen seen;
  PartSeeds seeds(seen.clip, seen.tracks, kRange);
  std::vector<bool> taken(seen.tracks.size(), false);
  for (size_t i = seen.moving.first; i < seen.moving.end; ++i) taken[i] = true;
  for (int i = 0; i < 20; ++i) seen.tracks.push_back(seen.tracks[seen.moving.first]), taken.push_back(false);
  CHECK(seen.shaded.Has(seeds.Next(taken)));
  std::fill(taken.begin(), taken.end(), true);
  CHECK(seeds.Next(taken) == seen.tracks.size());
}
