// Where a scene's light comes from, as the shadows say that its parts cast on what stands still.
//
// Seen along the light, the space that a part shades is the part's outline: a function of two coordinates, whatever the
// part's height above what it shades. So of all directions the light's is the one in which being in the shade is told
// best by where a place lies behind a part.
#pragma once

#include <torch/types.h>

#include <optional>

#include "libeditnerf/geometry/vec3.h"
#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

struct Lamp {
  Vec3 direction;        // towards it, unit length, scene axes
  double explained = 0;  // share of the variance of being in the shade, at most 1
  double usual = 0;      // the same for the median of all directions
};

// `still`: places marked by MarkUnsteadyPlaces; `parts`: those that key points carry, from which the parts' sizes are
// known; tracks [T, N, 3] of the key points, scene units. Nothing where too few places are ever shaded, or no direction
// stands out: light from all sides, or nothing that casts a shadow.
std::optional<Lamp> FindLamp(const Clip& clip, const DepthTargets& still, const DepthTargets& parts,
                             const torch::Tensor& tracks);

}  // namespace editnerf
