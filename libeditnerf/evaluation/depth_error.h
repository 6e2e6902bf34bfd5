// How far depth maps are from exact ones, for each part of a synthetic scene by itself: what key point detection stands
// on is the depth of what moves, and the picture's PSNR does not show it.
#pragma once

#include <torch/types.h>

#include <string>
#include <vector>

#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

struct DepthError {
  std::string part;                     // "static", or the object's name
  double median = 0, percentile90 = 0;  // |depth - truth| / truth; a pixel without a surface counts as 1
  int64_t pixels = 0;
};

// depth [K, H, W], NaN where there is no surface, of training frames number rows[0] to rows[K - 1] of the scene. Pixels
// at which the truth hits nothing are left out, and so are parts without pixels. With an odd `every` depth is
// [K, H / every, W / every], what the middle pixel of each square of that side sees. Throws DataError if the scene has
// no ground truth, and ShapeError.
std::vector<DepthError> MeasureDepthErrors(const torch::Tensor& depth, const Scene& scene,
                                           const std::vector<int64_t>& rows, int64_t every = 1);

// Of known distances in training frames, by the part that is truly seen there; empty without ground truth.
std::vector<DepthError> MeasureDepthTargets(const Scene& scene, const DepthTargets& targets);

// One line of the log for each part on which distances are known; none without ground truth.
void LogDepthTargetErrors(const Scene& scene, const DepthTargets& targets);

}  // namespace editnerf
