#include "libeditnerf/tracking/lamp.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/place_light.h"
#include "libeditnerf/training/drawn_states.h"

namespace editnerf {
namespace {

constexpr size_t kShadedPlaces = 3000, kOtherPlaces = 1000;  // that are looked at
constexpr double kLit = 0.9;                                 // percentile of a place's light that counts as unshaded
constexpr float kShaded = -0.1F, kUnshaded = -0.05F;         // logarithm of how much darker
constexpr int64_t kFewestShaded = 300;                       // observations
constexpr double kSides = 3.5;                               // of the square behind a part, in parts' reaches
constexpr int64_t kCells = 40;                               // along a side
constexpr double kBehind = -0.09;                            // of the reach: from where on a place lies behind
constexpr int64_t kFewestSeen = 5;                           // observations that tell of a cell
constexpr int64_t kRounds = 3;                               // of settling which part it was
constexpr int64_t kDirections = 400;                         // over the whole sphere, some 10 degrees apart
constexpr double kFirstTurn = 0.1, kLastTurn = 0.015;        // radians, of the search around the best
constexpr double kLeastExplained = 0.15, kLeastAboveUsual = 0.05;

enum class Shade : int8_t { kUnknown, kLight, kDark };

struct Observations {
  int64_t looks = 0;
  std::vector<Vec3> place;            // P
  std::vector<Shade> shade;           // [P * looks]
  std::vector<std::vector<Vec3>> at;  // [N][looks], the key points
  std::vector<double> reach;          // [N], 0 where a part's places are not known
  int64_t dark = 0, light = 0;
};

Vec3 PositionOf(const Clip& clip, const DepthTargets& places, int64_t i) {
  const int64_t* const pixel = places.pixel.data_ptr<int64_t>() + 2 * i;
  return clip.Lift(places.frame.data_ptr<int64_t>()[i],
                   {static_cast<double>(pixel[0]) + 0.5, static_cast<double>(pixel[1]) + 0.5},
                   static_cast<double>(places.distance.data_ptr<float>()[i]));
}

// Rows of `places` with that mark, evenly spread, at most `most`.
std::vector<int64_t> Some(const DepthTargets& places, int64_t mark, size_t most) {
  const int64_t* const marks = places.key_point.data_ptr<int64_t>();
  std::vector<int64_t> all;
  for (int64_t i = 0; i < places.size(); ++i)
    if (marks[i] == mark) all.push_back(i);
  if (all.size() <= most) return all;
  std::vector<int64_t> some;
  for (size_t i = 0; i < most; ++i) some.push_back(all[i * all.size() / most]);
  return some;
}

std::vector<double> ReachOf(const Clip& clip, const DepthTargets& parts, const torch::Tensor& tracks) {
  torch::Tensor places = torch::empty({parts.size(), 3}, torch::kFloat64);
  for (int64_t i = 0; i < parts.size(); ++i) {
    const Vec3 at = PositionOf(clip, parts, i);
    double* const to = places.data_ptr<double>() + 3 * i;
    to[0] = at.x, to[1] = at.y, to[2] = at.z;
  }
  const torch::Tensor reach = PartReach(places, parts.frame, parts.key_point, tracks);
  std::vector<double> each(static_cast<size_t>(tracks.size(1)), 0);
  if (reach.defined()) std::copy_n(reach.data_ptr<double>(), each.size(), each.begin());
  return each;
}

Observations Observe(const Clip& clip, const DepthTargets& still, const DepthTargets& parts,
                     const torch::Tensor& tracks) {
  Observations seen;
  const std::vector<int64_t> frames = FramesLookedAt(clip);
  seen.looks = static_cast<int64_t>(frames.size());
  std::vector<int64_t> rows = Some(still, kOtherLight, kShadedPlaces);
  for (const int64_t i : Some(still, kStandsStill, kOtherPlaces)) rows.push_back(i);
  const torch::Tensor row = torch::tensor(rows, torch::kInt64);
  const DepthTargets places = {still.frame.index_select(0, row), still.pixel.index_select(0, row),
                               still.distance.index_select(0, row), still.tolerance.index_select(0, row),
                               still.key_point.index_select(0, row)};
  const std::vector<float> light = LightOfPlaces(clip, places, frames);
  seen.shade.assign(light.size(), Shade::kUnknown);
  for (int64_t i = 0; i < places.size(); ++i) {
    seen.place.push_back(PositionOf(clip, places, i));
    const auto first = static_cast<size_t>(i * seen.looks);
    std::vector<double> known;
    for (size_t look = 0; look < frames.size(); ++look)
      if (!std::isnan(light[first + look])) known.push_back(static_cast<double>(light[first + look]));
    if (known.empty()) continue;
    const auto lit = static_cast<float>(Percentile(std::move(known), kLit));
    for (size_t look = 0; look < frames.size(); ++look) {
      const float darker = light[first + look] - lit;
      if (darker < kShaded) seen.shade[first + look] = Shade::kDark, ++seen.dark;
      if (darker > kUnshaded) seen.shade[first + look] = Shade::kLight, ++seen.light;
    }
  }
  const torch::Tensor positions = tracks.to(torch::kCPU, torch::kFloat64).contiguous();
  const auto track = positions.accessor<double, 3>();
  seen.reach = ReachOf(clip, parts, positions);
  for (int64_t n = 0; n < track.size(1); ++n) {
    seen.at.emplace_back();
    for (const int64_t t : frames) seen.at.back().push_back({track[t][n][0], track[t][n][1], track[t][n][2]});
  }
  return seen;
}

using Cells = std::vector<std::vector<int16_t>>;    // [N][P * looks], -1 where a place is not behind the part
using Darkness = std::vector<std::vector<double>>;  // [N][cells], share of what is seen there that is in the shade

// Where places lie behind each part, seen along the light.
Cells CellsBehind(const Observations& seen, const Vec3& lamp) {
  const auto [u, v] = Across(lamp);
  const auto looks = static_cast<size_t>(seen.looks);
  Cells cells(seen.at.size(), std::vector<int16_t>(seen.shade.size(), -1));
  for (size_t n = 0; n < cells.size(); ++n) {
    if (seen.reach[n] == 0) continue;
    const double per_cell = static_cast<double>(kCells) / (kSides * seen.reach[n]);
    for (size_t i = 0; i < seen.shade.size(); ++i) {
      if (seen.shade[i] == Shade::kUnknown) continue;
      const Vec3 apart = seen.place[i / looks] - seen.at[n][i % looks];
      if (-Dot(apart, lamp) < kBehind * seen.reach[n]) continue;
      const auto a = static_cast<int64_t>(std::floor(Dot(apart, u) * per_cell + kCells / 2.0));
      const auto b = static_cast<int64_t>(std::floor(Dot(apart, v) * per_cell + kCells / 2.0));
      if (a >= 0 && a < kCells && b >= 0 && b < kCells) cells[n][i] = static_cast<int16_t>(a * kCells + b);
    }
  }
  return cells;
}

double DarknessAt(const Darkness& darkness, const Cells& cells, size_t n, size_t i) {
  return cells[n][i] < 0 ? 0 : darkness[n][static_cast<size_t>(cells[n][i])];
}

// The darkest that any part but `except` makes observation i.
double Darkest(const Darkness& darkness, const Cells& cells, size_t i, size_t except) {
  double darkest = 0;
  for (size_t n = 0; n < cells.size(); ++n)
    if (n != except) darkest = std::max(darkest, DarknessAt(darkness, cells, n, i));
  return darkest;
}

// Where several parts might have been it, the one whose cell was darker in the last round takes the more of the blame;
// in the first, with no `before`, all take all of it.
Darkness Blame(const Observations& seen, const Cells& cells, const Darkness& before) {
  Darkness next(cells.size(), std::vector<double>(kCells * kCells, 0));
  for (size_t n = 0; n < cells.size(); ++n) {
    std::vector<double> light(kCells * kCells, 0), dark(kCells * kCells, 0);
    for (size_t i = 0; i < seen.shade.size(); ++i) {
      if (cells[n][i] < 0) continue;
      const auto at = static_cast<size_t>(cells[n][i]);
      if (seen.shade[i] == Shade::kLight) {
        light[at] += 1;
      } else if (before.empty()) {
        dark[at] += 1;
      } else {
        const double own = DarknessAt(before, cells, n, i), others = Darkest(before, cells, i, n);
        dark[at] += own * own / (own * own + others * others + 1e-9);
      }
    }
    for (size_t at = 0; at < light.size(); ++at) {
      const double observed = light[at] + dark[at];
      if (observed >= kFewestSeen) next[n][at] = dark[at] / observed;
    }
  }
  return next;
}

// How well the shade behind each part, seen along the light, tells what was observed: 1 - (squared error) / (that of
// the mean).
double Explained(const Observations& seen, const Vec3& lamp) {
  const Cells cells = CellsBehind(seen, lamp);
  Darkness darkness;
  for (int64_t round = 0; round < kRounds; ++round) darkness = Blame(seen, cells, darkness);
  double error = 0;
  for (size_t i = 0; i < seen.shade.size(); ++i) {
    if (seen.shade[i] == Shade::kUnknown) continue;
    const double miss = (seen.shade[i] == Shade::kDark ? 1 : 0) - Darkest(darkness, cells, i, cells.size());
    error += miss * miss;
  }
  const auto dark = static_cast<double>(seen.dark), light = static_cast<double>(seen.light);
  return 1 - error * (dark + light) / (dark * light);
}

// Evenly spread over the sphere, along a spiral.
Vec3 DirectionNumber(int64_t i) {
  const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(kDirections);
  const double angle = static_cast<double>(i) * M_PI * (3 - std::sqrt(5.0)), radius = std::sqrt(1 - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

}  // namespace

std::optional<Lamp> FindLamp(const Clip& clip, const DepthTargets& still, const DepthTargets& parts,
                             const torch::Tensor& tracks) {
  if (still.size() == 0 || parts.size() == 0) return std::nullopt;
  const Observations seen = Observe(clip, still, parts, tracks);
  if (seen.dark < kFewestShaded || seen.light < kFewestShaded) return std::nullopt;
  std::vector<double> explained(kDirections);
  ParallelFor(kDirections, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) explained[static_cast<size_t>(i)] = Explained(seen, DirectionNumber(i));
  });
  const auto best = std::max_element(explained.begin(), explained.end());
  Lamp lamp = {DirectionNumber(best - explained.begin()), *best, Percentile(explained, 0.5)};
  for (double turn = kFirstTurn; turn > kLastTurn; turn /= 2) {
    for (bool better = true; better;) {
      better = false;
      const Vec3 center = lamp.direction;
      const auto [u, v] = Across(center);
      for (const Vec3& aside : {u, v, u * -1.0, v * -1.0}) {
        const Vec3 direction = Normalized(center + aside * turn);
        const double found = Explained(seen, direction);
        if (found <= lamp.explained) continue;
        lamp.direction = direction, lamp.explained = found, better = true;
      }
    }
  }
  if (lamp.explained < kLeastExplained || lamp.explained < lamp.usual + kLeastAboveUsual) return std::nullopt;
  return lamp;
}

}  // namespace editnerf
