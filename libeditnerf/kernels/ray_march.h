// Equal steps along rays through occupancy grids, on the CPU. A ray is clipped against the boxes first; what is left of
// it is looked up many samples at a time, rounded just as OccupancyGrid::Occupied does it, so that the samples are
// those of the LibTorch way (MarchCandidates, PackSamples).
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

namespace editnerf {

// Samples of R rays in ray order, ascending along each ray.
struct PackedSamples {
  at::Tensor ray;      // [S] int64, ascending
  at::Tensor t;        // [S]
  at::Tensor delta;    // [S], length of the interval that the sample stands for
  at::Tensor offsets;  // [R + 1] int64: samples of ray r are offsets[r] .. offsets[r + 1] - 1
};

// Which cells of a box hold something.
struct OccupancyBits {
  at::Tensor low, high;  // [3] float64
  at::Tensor occupied;   // [resolution^3] bool, x slowest
  int64_t resolution = 0;
};

// float32 on the CPU.
struct MarchedRays {
  at::Tensor origin, direction;  // [R, 3], R >= 1
  at::Tensor jitter;             // [R] in [0, 1], where in their intervals a ray's samples lie
  at::Tensor anchor;             // [R, 3], read with a local grid alone
  at::Tensor turn;               // [R, 3, 3], likewise; undefined: none
};

// The samples t_i = near + (i + jitter) (far - near) / steps, 0 <= i < steps, for which x = origin + t_i direction lies
// in an occupied cell of `grid` and turn (x - anchor) in one of `local`, unless that is nullptr. NaN and what lies
// outside a box is not occupied. Where nothing at all is to be kept, the first sample of the first ray is. Without
// gradients; throws ShapeError for other shapes, types or devices.
PackedSamples MarchRays(const MarchedRays& rays, double near, double far, int64_t steps, const OccupancyBits& grid,
                        const OccupancyBits* local = nullptr);

}  // namespace editnerf
