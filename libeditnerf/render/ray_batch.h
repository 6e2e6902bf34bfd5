// What is asked of rays, and what they answer.
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "libeditnerf/field/radiance_field.h"

namespace editnerf {

struct RayBatch {
  torch::Tensor origin;     // [R, 3], scene units
  torch::Tensor direction;  // [R, 3], unit length
  torch::Tensor state;      // [R] int64, row of FrameStates
};

struct RayOptions {
  bool training = false;     // random sample positions, and the coarse level's colours
  torch::Tensor background;  // [3] or [R, 3]; undefined: see above
  bool surface = true;       // fill RayResult's surface outputs
  bool distortion = false;   // fill RayResult's distortion
  torch::Tensor distance;    // [R], known distance to the surface, NaN where unknown; undefined: nothing is known
  torch::Tensor tolerance;   // [R], share of the distance within which any is as good; given with it
  // Marching alone:
  torch::Tensor jitter;     // [R] in [0, 1], where in their intervals samples lie; undefined: random where training,
                            // otherwise the middle
  int64_t march_steps = 0;  // 0: as configured
  torch::Tensor start;      // [R], distance before which there is nothing to see, more or less; undefined: unknown
  double color_error = 0;   // share of a ray's light that may take its colour from the rest of it (fused kernels)
  bool depth_only = false;  // no colours, and nothing behind the surface (median depth) is evaluated
};

struct RayResult {
  torch::Tensor rgb;          // [R, 3]
  torch::Tensor rgb_coarse;   // [R, 3]; undefined unless training a field that has a coarse level
  torch::Tensor opacity;      // [R]; an opaque end does not count
  torch::Tensor depth;        // [R], distance to the surface (median); NaN where there is none
  torch::Tensor depth_valid;  // [R] bool

  // At the surface sample; without meaning where depth_valid is false. Undefined where the field has no such output.
  torch::Tensor x_observed;   // [R, 3]
  torch::Tensor x_canonical;  // [R, 3]
  torch::Tensor ambient;      // [R, A]
  torch::Tensor weights;      // [R, N], of the key points

  torch::Tensor distortion;  // [R], DistortionLoss with 0 at near and 1 at far; undefined unless asked for
  torch::Tensor depth_miss;  // [], mean over the rays of sum_i w_i max(0, |t_i - d| / d - tolerance), 0 where the
                             // distance d is unknown; undefined without RayOptions::distance
  torch::Tensor
      front;  // [R], where a ray first meets something (RayPicture::front); undefined but for the fused kernels
  int64_t samples = 0;  // field evaluations with colour
};

// What training wants of rays, beside RayOptions:
//   mean emphasis |rgb - target|^2 + distortion * mean distortion loss + ambient * mean |a|^2 at surface points
//   + depth * mean depth miss (RayResult::depth_miss)
// all over the rays; one without surface counts 0 in the third.
struct RayObjective {
  torch::Tensor target;    // [R, 3]
  torch::Tensor emphasis;  // [R]; undefined: all 1
  double distortion = 0;   // weight of the distortion loss with 0 at near and 1 at far
  double ambient = 0;      // weight of the squared ambient coordinates
  double depth = 0;        // weight of missing RayOptions::distance
  double roulette = 0;     // size of gradients below which few samples go back for all, see RayLoss
};

struct RayGradients {
  torch::Tensor missed;                                               // [R], mean over the channels of (rgb - target)^2
  double reconstruction = 0, distortion = 0, ambient = 0, depth = 0;  // the terms, weighted
  FrameStates states;    // gradients of the states' tables; undefined where unused
  int64_t samples = 0;   // field evaluations with colour
  int64_t returned = 0;  // those whose gradients were taken
};

}  // namespace editnerf
