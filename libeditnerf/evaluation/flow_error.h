// How far optical flow is from the exact one of a synthetic scene, apart for what is static and what moves, and apart
// near edges between them, where dense flow mixes both motions.
#pragma once

#include <torch/types.h>

#include <array>
#include <cstdint>
#include <vector>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// Where the surface at each pixel's centre goes, from cameras, depth and the objects' transforms.
struct TrueFlow {
  torch::Tensor flow;     // [H, W, 2] float32, pixels; NaN where nothing is hit or the point is behind the camera
  torch::Tensor visible;  // [H, W] bool: the place is inside the other image, whose mask and depth agree with it
  torch::Tensor moving;   // [H, W] bool: on an object whose transform differs between the two frames
};

// from, to: indices into scene.frames. Throws DataError if the scene has no ground truth.
TrueFlow ComputeTrueFlow(const Scene& scene, int64_t from, int64_t to);

// Where the flow is asked.
enum class FlowPart { kStatic, kStaticEdge, kMoving, kMovingEdge };
constexpr std::array<const char*, 4> kFlowPartNames = {"static", "static near an edge", "moving",
                                                       "moving near an edge"};

struct FlowError {
  FlowPart part = FlowPart::kStatic;
  double median = 0, percentile90 = 0;  // end-point error |flow - truth|, pixels; a pixel without flow counts as inf
  int64_t pixels = 0;
};

// Collects the visible pixels of one pair after the other.
class FlowErrors {
 public:
  // "Near an edge": within `edge` pixels, along rows or columns, of a pixel on another object or the static scene.
  explicit FlowErrors(int64_t edge = 3) : edge_(edge) {}

  // flow [H, W, 2] from frame `from` to frame `to` of the scene. Throws DataError and ShapeError.
  void Add(const torch::Tensor& flow, const Scene& scene, int64_t from, int64_t to);

  std::vector<FlowError> Summary() const;  // parts without pixels are left out

 private:
  int64_t edge_;
  std::array<std::vector<torch::Tensor>, 4> errors_;
};

}  // namespace editnerf
