// Where the ambient coordinates of the pretrained field vary over time, as a volume in canonical space.
//
// EditableNeRF (Zheng et al., CVPR 2023), section 3.3, in three dimensions as the paper describes it: the surface
// points of all pixels of all frames fall into voxels together with their ambient coordinates a; a voxel's value is the
// variance of a over the frames that saw it, averaged over the ambient dimensions. Within a frame a voxel counts once,
// with its mean: otherwise a frame that sees it from nearby would outvote the others. All arithmetic is in float32.
//
// Beyond the paper: on a real capture the ambient coordinates vary wherever the pretrained field was free to, on walls
// without texture above all. Where it is known which pixels move (motion_evidence.h), what counts is the standard
// deviation of a times the number of frames in which a surface in the voxel moved.
#pragma once

#include <torch/types.h>

#include <array>
#include <vector>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

struct SurfaceVolumeOptions {
  int64_t resolution = 96;       // voxels along the longest side
  int64_t min_observations = 6;  // frames that must have seen a voxel
  double smoothing = 2.0;        // standard deviation of the Gaussian, voxels
  int64_t stride = 1;            // take every stride-th pixel along both axes
};

struct SurfaceVolume {
  torch::Tensor observations;  // [X, Y, Z] int32, frames that saw the voxel
  torch::Tensor variance;      // [X, Y, Z] float32, 0 where observations < min_observations
  torch::Tensor moving;        // [X, Y, Z] int32, frames in which a surface in the voxel moved; undefined if unknown
  torch::Tensor smoothed;  // [X, Y, Z] float32, masked Gaussian of `variance`, or of sqrt(variance) * moving; 0 where
                           // observations < min_observations
  Vec3 origin;             // corner of voxel (0, 0, 0), scene units
  double voxel_size = 0;   // scene units

  Vec3 Center(int64_t x, int64_t y, int64_t z) const {
    return origin +
           Vec3{static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, static_cast<double>(z) + 0.5} * voxel_size;
  }
  double LongestSide() const;  // scene units
};

// points [T, H, W, 3] float32, ambient [T, H, W, A] float32; points that are not finite are left out. The volume spans
// the 1st to 99th percentile of the points along each axis and a margin of three voxels. `moving` [T, H, W] bool:
// which pixels move; may be undefined.
// Throws DataError when no point is finite.
SurfaceVolume BuildSurfaceVolume(const torch::Tensor& points, const torch::Tensor& ambient,
                                 const SurfaceVolumeOptions& options, const torch::Tensor& moving = {});

// Gaussian of the observed voxels alone: G * (m v) / max(G * m, floor). The floor, a third of what a plane of voxels
// gives, keeps single floating voxels from standing out. values, mask [X, Y, Z] float32.
torch::Tensor MaskedGaussian(const torch::Tensor& values, const torch::Tensor& mask, double sigma);

struct VolumeMaximum {
  Vec3 point;        // voxel centre, scene units
  double value = 0;  // of the smoothed variance
  std::array<int64_t, 3> voxel = {0, 0, 0};
};

// Local maxima (over the 26 neighbours) of `smoothed`, strongest first, none nearer than `min_distance` (share of the
// longest side) to a stronger one, none below `relative_threshold` times the strongest.
std::vector<VolumeMaximum> LocalMaxima(const SurfaceVolume& volume, double min_distance, double relative_threshold);

}  // namespace editnerf
