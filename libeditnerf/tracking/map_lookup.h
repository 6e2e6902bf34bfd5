// Reading flow and depth maps at pixel positions, with validity. Pixel centres lie at +0.5.
#pragma once

#include <torch/types.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace editnerf {

struct Pixel {
  double u = 0, v = 0;
};

inline bool InsideImage(const Pixel& p, int64_t width, int64_t height) {
  return p.u >= 0 && p.v >= 0 && p.u < static_cast<double>(width) && p.v < static_cast<double>(height);
}

inline double Distance(const Pixel& a, const Pixel& b) { return std::hypot(a.u - b.u, a.v - b.v); }

// A flow map's displacement at a position. `valid` is false outside the image and where pixels that carry half of the
// bilinear weight or more are NaN or masked out; the others are then left out of the mean.
struct FlowSample {
  double du = 0, dv = 0;
  bool valid = false;    // a displacement exists
  bool checked = false;  // and it is backed by the mask (forward and backward flow agree)
};

// flow [H, W, 2] float32 contiguous; mask [H, W] bool contiguous, or undefined for "all valid".
FlowSample SampleFlow(const torch::Tensor& flow, const torch::Tensor& mask, const Pixel& p);

// Robust depth around a position: the median of one surface among the finite depths of a (2 radius + 1)^2 window.
// Where the window straddles a discontinuity (a gap of more than `gap` times the depth) its depths are split there, and
// the cluster nearest to `expected` is taken; without an expectation (NaN) the nearest to the camera that covers at
// least a quarter of the window, because key points sit on parts that stand out. NaN outside the image and where no
// pixel of the window has a surface. depth [H, W] float32 contiguous.
double LocalDepth(const torch::Tensor& depth, const Pixel& p, int64_t radius, double expected = NAN, double gap = 0.03);

}  // namespace editnerf
