// Static points that explain a pixel's way through the frames: what flow and cameras say of depth, and of motion,
// before any field is learnt.
//
// A pixel is followed by checked flow. A static point at distance d along its ray projects into the frames around by
// the cameras alone; the largest distance to where the pixel really went is its miss. Over all d the smallest miss says
// whether the pixel can belong to the static scene, and how fast the miss grows around it how well d is determined. A
// part that moves along its epipolar line as a static point of another depth would is not told apart: the monocular
// ambiguity.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/tracking/clip.h"

namespace editnerf {

// How much an image changes around a pixel, and along which direction: the structure tensor of a small window. Along an
// edge flow is filled in from elsewhere, and misses do not count; where nothing changes flow says nothing.
struct Texture {
  double xx = 0, xy = 0, yy = 0;  // grey levels per pixel, squared

  double Strongest() const;  // along the direction of most change
  bool Enough() const { return Strongest() >= 4; }
};
Texture TextureAround(const torch::Tensor& gray, const Pixel& p);  // gray [H, W] float32 contiguous, 0 to 255

// Where checked flow leads from a pixel, up to `reach` frames forwards and backwards, farthest frames first.
struct Chain {
  std::vector<int64_t> frame;
  std::vector<Pixel> pixel;

  bool empty() const { return frame.empty(); }
};
Chain FollowFlow(const Clip& clip, int64_t t, const Pixel& p, int64_t reach);

struct DepthRange {
  double near = NAN, far = NAN;  // scene units, along the ray
};

struct StillPoint {
  double miss = NAN;       // pixels, across the image's edges; NaN where the static point leaves a camera's view
  double distance = NAN;   // scene units, along the ray
  double precision = NAN;  // share of the distance by which it may change until the miss has grown by one pixel at 320
                           // wide; infinity where it may change by kLoosest and more
};
constexpr double kLoosest = 0.4;

// The static point within a range that misses least. `chain` must not be empty, and the texture Enough().
StillPoint FindStillPoint(const Clip& clip, int64_t t, const Pixel& p, const DepthRange& range, const Chain& chain,
                          const Texture& texture);

}  // namespace editnerf
