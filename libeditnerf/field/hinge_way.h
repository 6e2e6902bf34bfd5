// How a part on a hinge goes on where no frame shows it any more: about the same axis. An edit may open a lid further
// than the clip did.
#pragma once

#include <torch/types.h>

namespace editnerf {

struct HingeWay {
  torch::Tensor coordinates;  // [B, 3]
  torch::Tensor turns;        // [B, 3] rotation vectors, radians
};

// Beyond both ends of the way that a point of the part goes, each by `share` of the angle from one to the other, in as
// many rows as the frames have for such an angle. coordinates [T, 3] of the point, in any units; turns [T, 3] rotation
// vectors from the part's own axes to those of the coordinates. No rows where these are not about one axis, do not
// explain the point's way, or are less than ten degrees from one end to the other, and where nothing lies beyond, as
// the part goes all the way round. Throws ShapeError.
HingeWay BeyondHinge(const torch::Tensor& coordinates, const torch::Tensor& turns, double share);

}  // namespace editnerf
