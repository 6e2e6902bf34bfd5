#include "libeditnerf/tracking/lamp.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/place_light.h"

namespace editnerf {
namespace {

constexpr size_t kShadedPlaces = 3000, kOtherPlaces = 1000;  // that are looked at
constexpr double kLit = 0.9;                                 // percentile of a place's light that counts as unshaded
constexpr float kShaded = -0.1F, kUnshaded = -0.05F;         // logarithm of how much darker
constexpr int64_t kFewestShaded = 300;                       // observations
constexpr double kPartSize = 0.98;                           // percentile of its places' distances from the key point
constexpr double kSides = 4;                                 // of the square behind a part, in such distances
constexpr int64_t kCells = 40;                               // along a side
constexpr double kBehind = -0.1;                             // of that distance: from where on a place lies behind
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
  std::vector<double> size;           // [N], 0 where a part's places are not known
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

std::vector<double> SizesOf(const Clip& clip, const DepthTargets& parts,
                            const torch::TensorAccessor<double, 3>& tracks) {
  std::vector<double> sizes;
  for (int64_t n = 0; n < tracks.size(1); ++n) {
    std::vector<double> away;
    for (int64_t i = 0; i < parts.size(); ++i) {
      if (parts.key_point.data_ptr<int64_t>()[i] != n) continue;
      const auto key = tracks[parts.frame.data_ptr<int64_t>()[i]][n];
      away.push_back(Norm(PositionOf(clip, parts, i) - Vec3{key[0], key[1], key[2]}));
    }
    sizes.push_back(away.empty() ? 0 : Percentile(std::move(away), kPartSize));
  }
  return sizes;
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
  seen.size = SizesOf(clip, parts, track);
  for (int64_t n = 0; n < track.size(1); ++n) {
    seen.at.emplace_back();
    for (const int64_t t : frames) seen.at.back().push_back({track[t][n][0], track[t][n][1], track[t][n][2]});
  }
  return seen;
}

// How well the shade behind each part, seen along the light, tells what was observed: 1 - (squared error) / (that of
// the mean). Where several parts might have been it, the one whose cell is darker takes the more of the blame.
double Explained(const Observations& seen, const Vec3& lamp) {
  const Vec3 off = std::abs(lamp.z) < 0.7 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
  const Vec3 u = Normalized(Cross(off, lamp)), v = Cross(lamp, u);
  const size_t parts = seen.at.size(), each = seen.shade.size();
  std::vector<std::vector<int16_t>> cell(parts, std::vector<int16_t>(each, -1));
  for (size_t n = 0; n < parts; ++n) {
    if (seen.size[n] == 0) continue;
    const double per_cell = static_cast<double>(kCells) / (kSides * seen.size[n]);
    for (size_t i = 0; i < each; ++i) {
      if (seen.shade[i] == Shade::kUnknown) continue;
      const Vec3 apart =
          seen.place[i / static_cast<size_t>(seen.looks)] - seen.at[n][i % static_cast<size_t>(seen.looks)];
      if (-Dot(apart, lamp) < kBehind * seen.size[n]) continue;
      const auto a = static_cast<int64_t>(std::floor(Dot(apart, u) * per_cell + kCells / 2.0));
      const auto b = static_cast<int64_t>(std::floor(Dot(apart, v) * per_cell + kCells / 2.0));
      if (a >= 0 && a < kCells && b >= 0 && b < kCells) cell[n][i] = static_cast<int16_t>(a * kCells + b);
    }
  }
  std::vector<std::vector<double>> darkness(parts, std::vector<double>(kCells * kCells, 0));
  const auto darkness_at = [&](size_t n, size_t i) {
    return cell[n][i] < 0 ? 0 : darkness[n][static_cast<size_t>(cell[n][i])];
  };
  for (int64_t round = 0; round < kRounds; ++round) {
    std::vector<std::vector<double>> next(parts, std::vector<double>(kCells * kCells, 0));
    for (size_t n = 0; n < parts; ++n) {
      std::vector<double> light(kCells * kCells, 0), dark(kCells * kCells, 0);
      for (size_t i = 0; i < each; ++i) {
        if (cell[n][i] < 0) continue;
        const auto at = static_cast<size_t>(cell[n][i]);
        if (seen.shade[i] == Shade::kLight) {
          light[at] += 1;
          continue;
        }
        double own = darkness_at(n, i), others = 0;
        for (size_t m = 0; m < parts; ++m)
          if (m != n) others = std::max(others, darkness_at(m, i));
        own *= own, others *= others;
        dark[at] += round == 0 ? 1 : own / (own + others + 1e-9);
      }
      for (size_t at = 0; at < light.size(); ++at) {
        const double seen_here = light[at] + dark[at];
        if (seen_here >= kFewestSeen) next[n][at] = dark[at] / seen_here;
      }
    }
    darkness = std::move(next);
  }
  double error = 0;
  for (size_t i = 0; i < each; ++i) {
    if (seen.shade[i] == Shade::kUnknown) continue;
    double told = 0;
    for (size_t n = 0; n < parts; ++n) told = std::max(told, darkness_at(n, i));
    const double miss = (seen.shade[i] == Shade::kDark ? 1 : 0) - told;
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
      const Vec3 center = lamp.direction, off = std::abs(center.z) < 0.7 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
      const Vec3 u = Normalized(Cross(off, center)), v = Cross(center, u);
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
