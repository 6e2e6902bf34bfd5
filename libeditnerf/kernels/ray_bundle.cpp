#include "libeditnerf/kernels/ray_bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/kernels/tile_layout.h"

namespace editnerf {
namespace {

// Rays that are marched side by side, and samples of each that are asked for at a time: one tile together. Few at a
// time, as all that a ray is asked for behind its end is in vain; but more once the last rays of a bundle alone are
// left, as a tile with few samples costs nearly as much as a full one.
constexpr int64_t kActive = 42;
constexpr int64_t kWave = 3, kLastWave = 16;
static_assert(kActive * kWave <= kTile);
// Of rays with many steps fewer are marched at a time: if nothing stops them, this many samples fill a bundle.
constexpr int64_t kMostSamples = 8192;
// Samples from which on a bundle takes no more rays: its tiles are to stay in the second-level cache.
constexpr int64_t kFull = 256;

}  // namespace

RayBundle::RayBundle(const FieldRows& rows) : rows_(rows), wave_(rows.count), keep_(1) { active_.reserve(kActive); }

int64_t RayBundle::Fill(const FieldKernel& field, const BundledRays& rays, bool for_gradients, int64_t first,
                        int64_t end) {
  const std::vector<RowRange>& kept_rows = for_gradients ? rows_.for_gradients : rows_.for_pictures;
  const double opaque = rays.early_stop > 0 ? -std::log(rays.early_stop) : std::numeric_limits<double>::infinity();
  const auto most_active =
      static_cast<size_t>(std::clamp<int64_t>(kMostSamples / std::max<int64_t>(rays.steps.count, 1), 1, kActive));
  rays_.clear();
  num_samples_ = 0;
  for (;;) {
    while (active_.size() < most_active && num_samples_ < kFull && first < end) {
      GridView local;
      if (rays.local_grid != nullptr) {
        local = {rays.local_grid, field.KeyPoints(rays.state[first]), field.LocalFrames(rays.state[first])};
      }
      Active ray;
      ray.cursor = RayCursor(*rays.grid, local, rays.steps, rays.origin + 3 * first, rays.direction + 3 * first,
                             rays.jitter[first], rays.FirstSample(first));
      ray.slot = static_cast<int32_t>(rays_.size());
      active_.push_back(ray);
      rays_.push_back(first++);
    }
    if (active_.empty()) break;
    AskForSamples(rays);
    if (wave_.count > 0) {
      field.Density(wave_.state, wave_.count, for_gradients, wave_.memory);
      StopRays(opaque, rays.delta);
      KeepSamples(kept_rows);
    }
    active_.erase(std::remove_if(active_.begin(), active_.end(), [](const Active& ray) { return ray.done; }),
                  active_.end());
  }
  SortSamples();
  return first;
}

// The next samples of every active ray, side by side in the wave.
void RayBundle::AskForSamples(const BundledRays& rays) {
  const ThreadPhase phase(Phase::kMarching);
  float *const t = wave_.memory.Row(rows_.t), *const slot = wave_.memory.Row(rows_.slot);
  float* const x = wave_.memory.Row(rows_.x);
  int64_t count = 0;
  const int64_t each = std::clamp(kTile / static_cast<int64_t>(active_.size()), kWave, kLastWave);
  for (Active& ray : active_) {
    for (ray.asked = 0; ray.asked < each; ++ray.asked, ++count) {
      float position[3];
      if (ray.cursor.Next(&t[count], position) < 0) {
        ray.done = true;
        break;
      }
      for (int axis = 0; axis < 3; ++axis) TileRow(x, axis)[count] = position[axis];
      slot[count] = static_cast<float>(ray.slot);
      wave_.state[count] = static_cast<int32_t>(rays.state[rays_[static_cast<size_t>(ray.slot)]]);
    }
  }
  wave_.count = count;
}

// Marks the samples that light still reaches.
void RayBundle::StopRays(double opaque, float delta) {
  const float* density = wave_.memory.Row(rows_.density);
  float* keep = keep_.rows();
  for (Active& ray : active_) {
    for (int32_t i = 0; i < ray.asked; ++i) {
      *keep++ = ray.thickness <= opaque ? 1.0F : 0.0F;
      ray.thickness += static_cast<double>(*density++) * static_cast<double>(delta);
    }
    ray.done = ray.done || ray.thickness > opaque;
  }
  std::fill(keep, keep_.rows() + kTileStride, 0.0F);
}

void RayBundle::KeepSamples(const std::vector<RowRange>& kept_rows) {
  const ThreadPhase phase(Phase::kMarching);
  const auto last = static_cast<size_t>(num_samples_ / kTile);
  while (tiles_.size() < last + 2) tiles_.push_back(std::make_unique<Tile>(rows_.count));
  const int64_t at = num_samples_ % kTile;
  int64_t kept = 0;
  for (const RowRange& range : kept_rows) {
    kept = AppendKept(keep_.rows(), wave_.memory.Row(range.first), wave_.count, range.count, at,
                      tiles_[last]->memory.Row(range.first), tiles_[last + 1]->memory.Row(range.first));
  }
  num_samples_ += kept;
}

// By ray; those of each ray were kept in their order.
void RayBundle::SortSamples() {
  const ThreadPhase phase(Phase::kMarching);
  offsets_.assign(rays_.size() + 1, 0);
  order_.resize(static_cast<size_t>(num_samples_));
  for (int64_t i = 0; i < num_tiles(); ++i) {
    tile(i).count = std::min(kTile, num_samples_ - i * kTile);
    const float* const slot = tile(i).memory.Row(rows_.slot);
    for (int64_t s = 0; s < tile(i).count; ++s) ++offsets_[static_cast<size_t>(slot[s]) + 1];
    std::fill_n(tile(i).memory.Row(rows_.chosen), kTileStride, 0.0F);
  }
  for (size_t r = 1; r < offsets_.size(); ++r) offsets_[r] += offsets_[r - 1];
  next_ = offsets_;
  for (int64_t i = 0; i < num_tiles(); ++i) {
    const float* const slot = tile(i).memory.Row(rows_.slot);
    for (int64_t s = 0; s < tile(i).count; ++s) {
      order_[static_cast<size_t>(next_[static_cast<size_t>(slot[s])]++)] = static_cast<int32_t>(i * kTile + s);
    }
  }
}

void RayBundle::Gather(int64_t row, float* values) {
  for (const int32_t sample : order_) *values++ = tile(sample / kTile).memory.Row(row)[sample % kTile];
}

void RayBundle::Scatter(const float* values, int64_t row) {
  for (const int32_t sample : order_) tile(sample / kTile).memory.Row(row)[sample % kTile] = *values++;
}

}  // namespace editnerf
