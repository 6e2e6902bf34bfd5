// Depth by triangulation along the optical flow, of the static scene and of parts while they rest: what pretraining may
// rely on from its first step.
//
// A pretrained HyperNeRF may give every frame a world of its own: where few frames see a surface, or none from another
// side, nothing in the colours says how far it is. But flow and cameras do, wherever there is texture and parallax
// (still_points.h). A distance is kept where flow leads to one static point over a window of frames, long ones before
// short ones, and where at most a fifth of that window's frames look through the point: what they see there is as near,
// or nearer.
#pragma once

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

// near and far: scene units, what is looked for. The clip's depth is not read. Throws Interrupted.
DepthTargets TriangulateStillDepth(const Clip& clip, double near, double far);

// Depth maps [T, H, W] with every target's distance in the pixels around it, up to `reach` to each side; float32.
torch::Tensor PutKnownDepth(const torch::Tensor& depth, const DepthTargets& targets, int64_t reach);

}  // namespace editnerf
