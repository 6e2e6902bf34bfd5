// The surfaces that a run sees in the training views: what key point detection stands on.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/evaluation/depth_error.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/tracking/pretrained_maps.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

// Depth, ambient coordinates and canonical positions at the surface of every training view. At most
// `max_pixels` are rendered in all: larger sequences at a fraction of their size, enlarged to the nearest pixel.
PretrainedMaps RenderSurfaceMaps(Run& run, const Scene& scene, int64_t max_pixels = 600'000);

// How far the depth is off that the run sees in 16 training views, through every third pixel of every third row. The
// scene needs ground truth.
std::vector<DepthError> MeasureDepth(const Run& run, const Scene& scene);

}  // namespace editnerf
