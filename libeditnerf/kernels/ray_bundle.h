// Some whole rays and those of their samples that light still reaches, in tiles, with their densities.
//
// A bundle takes rays as long as it has room, evaluates a few samples of each at a time and stops a ray once its
// transmittance falls below the limit, as MarchUntilOpaque does (render/ray_marcher.h). What that density pass computed
// stays in the tiles for colours and gradients; samples behind the end of a ray are squeezed out.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "libeditnerf/kernels/field_tile.h"
#include "libeditnerf/kernels/ray_cursor.h"

namespace editnerf {

struct BundledRays {
  int64_t count = 0;
  const float *origin = nullptr, *direction = nullptr;  // [R, 3]
  const float* jitter = nullptr;                        // [R]
  const float* start = nullptr;    // [R], distance before which there is nothing to see; nullptr: look everywhere
  const int64_t* state = nullptr;  // [R], rows of the field's states
  const MarchedGrid* grid = nullptr;
  const MarchedGrid* local_grid = nullptr;  // over l, for one key point; nullptr: none
  MarchedSteps steps;
  float delta = 0;        // length of a step
  double early_stop = 0;  // transmittance at which a ray ends; 0: never

  // The first sample that is looked at: a few before `start`, as it may be known from neighbours only. None, where it
  // is infinite.
  int64_t FirstSample(int64_t ray) const {
    if (start == nullptr) return 0;
    if (std::isinf(start[ray])) return steps.count;
    return std::max<int64_t>(0, steps.SampleBehind(start[ray], jitter[ray]) - kSamplesBeforeStart);
  }
};

class RayBundle {
 public:
  struct Tile {
    TileMemory memory;
    int64_t count = 0;
    int32_t state[kTileStride] = {};
    explicit Tile(int64_t rows) : memory(rows) {}
  };

  // Memory for a bundle of the field's; grows to what rays need and is then reused.
  explicit RayBundle(const FieldRows& rows);

  // Forgets what it held and takes rays from number `first` on; returns the first of [first, end) that it did not take.
  // Tiles hold what colours and surfaces need, or `for_gradients` everything that the density pass computed.
  int64_t Fill(const FieldKernel& field, const BundledRays& rays, bool for_gradients, int64_t first, int64_t end);

  int64_t num_rays() const { return static_cast<int64_t>(rays_.size()); }
  int64_t Ray(int64_t slot) const { return rays_[static_cast<size_t>(slot)]; }  // number of a ray; they are consecutive
  int64_t num_samples() const { return num_samples_; }

  // Samples of slot r in the order of the ray: order()[offsets()[r]] and so on, each tile * kTile + column.
  const std::vector<int32_t>& order() const { return order_; }
  const std::vector<int32_t>& offsets() const { return offsets_; }

  int64_t num_tiles() const { return (num_samples_ + kTile - 1) / kTile; }
  Tile& tile(int64_t index) { return *tiles_[static_cast<size_t>(index)]; }

  // values[k] = row `row` of sample order()[k], and back.
  void Gather(int64_t row, float* values);
  void Scatter(const float* values, int64_t row);

 private:
  struct Active {
    RayCursor cursor;
    int32_t slot = 0;
    double thickness = 0;
    int32_t asked = 0;
    bool done = false;
  };

  void AskForSamples(const BundledRays& rays);
  void StopRays(double opaque, float delta);
  void KeepSamples(const std::vector<RowRange>& kept_rows);
  void SortSamples();

  FieldRows rows_;
  Tile wave_;
  TileMemory keep_;
  std::vector<std::unique_ptr<Tile>> tiles_;
  std::vector<Active> active_;
  std::vector<int64_t> rays_;
  std::vector<int32_t> order_, offsets_, next_;
  int64_t num_samples_ = 0;
};

}  // namespace editnerf
