// Whole images of a field, without gradients, in chunks of rays so that memory stays bounded.
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/render/ray_renderer.h"

namespace editnerf {

struct ImageOptions {
  int64_t chunk = 2048;                           // rays at a time, in each thread
  torch::TensorOptions tensor = torch::kFloat32;  // type and device of the rays: those of the field
  torch::Tensor background;                       // [3]; undefined: as RayRenderer does without one
  int64_t march_steps = 0;                        // marching alone; 0: as configured
  bool depth_only = false;  // marching alone: no colours, and nothing behind the surface is evaluated
  // Where the fused kernels render, most rays begin shortly before what their neighbours see, and colours are evaluated
  // only of what shows (image_renderer.cpp); with `exact`, every ray is looked at as if it were alone.
  bool exact = false;
};

// Outputs that the field does not have are undefined. All lie on the field's device.
struct RenderedImage {
  torch::Tensor rgb;          // [H, W, 3]
  torch::Tensor opacity;      // [H, W]
  torch::Tensor depth;        // [H, W], distance along the ray in scene units; NaN where there is no surface
  torch::Tensor depth_valid;  // [H, W] bool
  torch::Tensor x_canonical;  // [H, W, 3], at the surface; without meaning where there is none, as all that follows
  torch::Tensor ambient;      // [H, W, A]
  torch::Tensor weights;      // [H, W, N], of the key points
  int64_t samples = 0;        // field evaluations with colour
};

// The image of `camera` (scene units) in the one state of `states` (tables of one row). The same samples are taken
// however the image is cut into chunks. Ctrl-C is looked at between chunks: throws Interrupted.
RenderedImage RenderImage(RadianceField& field, RayRenderer& renderer, const Camera& camera, const FrameStates& states,
                          const ImageOptions& options = {});

}  // namespace editnerf
