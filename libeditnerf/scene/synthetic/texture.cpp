#include "libeditnerf/scene/synthetic/texture.h"

#include <algorithm>

namespace editnerf::synthetic {
namespace {

uint64_t Mix(uint64_t x) {  // SplitMix64's finaliser
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ULL;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// Multipliers of a hash's words; far apart, so that neighbouring cells share nothing.
constexpr uint64_t kWord[4] = {0x9e3779b97f4a7c15ULL, 0xd1342543de82ef95ULL, 0xaf251af3b0f025b5ULL,
                               0xb564ef22ec7aece5ULL};

uint64_t Combined(uint64_t a, uint64_t b, uint64_t c, uint64_t d) {
  return a * kWord[0] + b * kWord[1] + c * kWord[2] + d * kWord[3] + 0x2545f4914f6cdd1dULL;
}

double ToUnit(uint64_t combined) { return static_cast<double>(Mix(combined) >> 11) * 0x1.0p-53; }

// Without the library call that std::floor is on baseline x86.
int64_t Floor(double x) {
  const auto truncated = static_cast<int64_t>(x);
  return truncated - (x < static_cast<double>(truncated) ? 1 : 0);
}

uint64_t Cell(double position) { return static_cast<uint64_t>(Floor(position)); }

Vec3 Lerp(const Vec3& a, const Vec3& b, double t) { return a + (b - a) * t; }

double Smooth(double t) { return t * t * (3 - 2 * t); }

// 0 below -width, 1 above +width: an edge that antialiasing can resolve.
double Step(double x, double width) { return Smooth(std::clamp(0.5 + 0.5 * x / width, 0.0, 1.0)); }

// Trilinear value noise in [0, 1].
double ValueNoise(const Vec3& p, uint64_t seed) {
  const int64_t ix = Floor(p.x), iy = Floor(p.y), iz = Floor(p.z);
  const double tx = Smooth(p.x - static_cast<double>(ix)), ty = Smooth(p.y - static_cast<double>(iy));
  const double tz = Smooth(p.z - static_cast<double>(iz));
  const uint64_t base = Combined(seed, static_cast<uint64_t>(ix), static_cast<uint64_t>(iy), static_cast<uint64_t>(iz));
  double sum = 0;
  for (uint64_t corner = 0; corner < 8; ++corner) {
    const uint64_t dx = corner & 1, dy = (corner >> 1) & 1, dz = corner >> 2;
    const double weight = (dx ? tx : 1 - tx) * (dy ? ty : 1 - ty) * (dz ? tz : 1 - tz);
    sum += weight * ToUnit(base + dx * kWord[1] + dy * kWord[2] + dz * kWord[3]);
  }
  return sum;
}

double Clouds(const Vec3& p, uint64_t seed, int octaves) {
  double sum = 0, weight = 0.5, total = 0;
  Vec3 q = p;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += weight * ValueNoise(q, seed + static_cast<uint64_t>(octave));
    total += weight;
    weight *= 0.6;
    q = q * 2.03 + Vec3{3.1, 1.7, 5.3};
  }
  return sum / total;
}

Vec3 ElementColor(const Texture& texture, uint64_t i, uint64_t j) {
  const Vec3 blend = Lerp(texture.first, texture.second, HashUnit(texture.seed + 11, i, j));
  const Vec3 own = {HashUnit(texture.seed + 12, i, j), HashUnit(texture.seed + 13, i, j),
                    HashUnit(texture.seed + 14, i, j)};
  return Lerp(blend, Vec3{0.08, 0.08, 0.08} + own * 0.75, texture.colorful * HashUnit(texture.seed + 15, i, j));
}

// Irregular tiles: the nearest of one random seed per grid cell decides the colour, the gap to the second the joint.
Vec3 Mosaic(const Texture& texture, double u, double v) {
  double nearest = 1e9, second = 1e9;
  uint64_t best_i = 0, best_j = 0;
  for (int dj = -1; dj <= 1; ++dj) {
    for (int di = -1; di <= 1; ++di) {
      const uint64_t i = Cell(u + di), j = Cell(v + dj);
      const double x = static_cast<double>(Floor(u) + di) + HashUnit(texture.seed + 1, i, j) - u;
      const double y = static_cast<double>(Floor(v) + dj) + HashUnit(texture.seed + 2, i, j) - v;
      const double distance = x * x + y * y;
      if (distance < nearest) {
        second = nearest;
        nearest = distance;
        best_i = i, best_j = j;
      } else if (distance < second) {
        second = distance;
      }
    }
  }
  const double joint = Step(std::sqrt(second) - std::sqrt(nearest) - 0.07, 0.06);
  return ElementColor(texture, best_i, best_j) * (0.62 + 0.38 * joint);
}

// One disc of random place, size and colour per cell of a grid, on the first colour.
Vec3 Dots(const Texture& texture, double u, double v) {
  const uint64_t i = Cell(u), j = Cell(v);
  const double radius = 0.2 + 0.2 * HashUnit(texture.seed + 3, i, j);
  const double room = 1 - 2 * radius;
  const double x = u - std::floor(u) - radius - room * HashUnit(texture.seed + 4, i, j);
  const double y = v - std::floor(v) - radius - room * HashUnit(texture.seed + 5, i, j);
  const double inside = Step(radius - std::sqrt(x * x + y * y), 0.05);
  Vec3 own = {HashUnit(texture.seed + 6, i, j), HashUnit(texture.seed + 7, i, j), HashUnit(texture.seed + 8, i, j)};
  own = Lerp(texture.second, own, texture.colorful);
  return Lerp(texture.first, own, inside);
}

}  // namespace

double HashUnit(uint64_t a, uint64_t b, uint64_t c, uint64_t d) { return ToUnit(Combined(a, b, c, d)); }

Vec3 Albedo(const Texture& texture, const SurfacePlace& place) {
  const double u = place.u / texture.scale, v = place.v / texture.scale;
  const Vec3 p = place.point / texture.scale;
  // Fine brightness variation on everything, so that no face is flat to the flow.
  const double grain = 0.74 + 0.52 * Clouds(p * 1.7 + Vec3{9.2, 4.4, 7.7}, texture.seed + 21, 2);
  Vec3 color = texture.first;
  switch (texture.pattern) {
    case Texture::Pattern::kPlain:
      break;
    case Texture::Pattern::kChecker: {
      const bool odd = ((Cell(u) + Cell(v)) & 1) != 0;
      const double own = 0.7 + 0.45 * HashUnit(texture.seed + 9, Cell(u), Cell(v));  // no two fields are alike
      color = (odd ? texture.first : texture.second) * own;
      break;
    }
    case Texture::Pattern::kStripes: {
      const double wobble = 0.5 * Clouds(p * 0.6, texture.seed, 2);
      const double phase = v + wobble + 0.25 * u;
      const double distance = 0.25 - std::abs(phase - std::floor(phase) - 0.5);
      color = Lerp(texture.first, texture.second, Step(distance, 0.05));
      break;
    }
    case Texture::Pattern::kWood: {
      const Vec3 bent = {p.x * 0.35, p.y, p.z};
      const double ring = std::sqrt(bent.y * bent.y + 2 * bent.z * bent.z) + 2.2 * Clouds(bent * 0.5, texture.seed, 3);
      const double t = ring - std::floor(ring);
      color = Lerp(texture.first, texture.second, t < 0.8 ? Smooth(t / 0.8) : Smooth((1 - t) / 0.2));
      break;
    }
    case Texture::Pattern::kClouds:
      color = Lerp(texture.first, texture.second, Smooth(std::clamp(2 * Clouds(p, texture.seed, 4) - 0.5, 0.0, 1.0)));
      break;
    case Texture::Pattern::kDots:
      color = Dots(texture, u, v);
      break;
    case Texture::Pattern::kMosaic:
      color = Mosaic(texture, u, v);
      break;
  }
  color = color * grain;
  return {std::min(color.x, 0.95), std::min(color.y, 0.95), std::min(color.z, 0.95)};
}

}  // namespace editnerf::synthetic
