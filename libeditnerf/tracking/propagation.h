// A pixel's way through the sequence, by optical flow.
//
// EditableNeRF, section 3.3: from its reference frame the 2-D position is propagated frame by frame, forwards and
// backwards (chaining), and every skip_interval frames the direct flow t_ref -> t is tried and taken where the
// forward-backward error is small (skipping propagation), which removes what chaining has accumulated.
//
// Beyond the paper:
// - Direct flow over large motions happily matches background to background with a perfect forward-backward error. So
//   it is taken only where the patch it leads to resembles the reference patch at least as much as the chain's does.
// - The frames between two anchors are corrected too: chained from both ends and blended.
// - A point whose flow fails the forward-backward check, that leaves the image, or before which something nearer
//   appears is lost, not followed; it is looked for again by direct flow from the last frame that saw it. A surface
//   that is suddenly farther away has two causes: the depth map misses the part, then the point is followed without
//   depth; or the chain slipped off the part's edge onto the background. Only in the second case the flow there is that
//   of the static scene.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/motion_evidence.h"

namespace editnerf {

struct PropagationOptions {
  int64_t skip_interval = 50;   // frames; 0: never
  double skip_max_error = 5.0;  // forward-backward distance, pixels of this clip
  double depth_jump = 0.06;     // a surface nearer by this share of the depth hides the point
  int64_t patience = 3;         // frames for which flow that fails its check is still followed
};

struct SkipLink {
  int64_t frame = 0;
  Pixel pixel;  // by direct flow from the reference frame
};

struct PixelTrack {
  int64_t reference_frame = 0;
  std::vector<Pixel> pixel;      // T; between visible frames interpolated, beyond them held
  std::vector<bool> visible;     // T; checked flow leads here and nothing nearer is in the way
  std::vector<double> distance;  // T; of the surface there along the ray, scene units; NaN where not visible, where
                                 // there is no surface, or where it disagrees with the frames around it
  std::vector<SkipLink> links;   // direct flows that were taken

  int64_t CountVisible() const;
};

// `direct` may be null: then there are no skips and lost points stay lost. `motion` may be null: then every surface
// that is suddenly farther away is a failure of the depth map. `start` must lie inside frame reference_frame.
PixelTrack Propagate(const Clip& clip, DirectFlows* direct, int64_t reference_frame, const Pixel& start,
                     const PropagationOptions& options, const MotionEvidence* motion = nullptr);

// Radius in pixels of the patches and depth windows at this clip's size.
int64_t PatchRadius(const Clip& clip);
int64_t DepthRadius(const Clip& clip);

}  // namespace editnerf
