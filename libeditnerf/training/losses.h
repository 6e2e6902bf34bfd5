// The losses of EditableNeRF (Zheng et al., CVPR 2023), section 3.4, and two regularisers of pretraining. All are
// scalar tensors in the dtype of their input; weights (lambda) are the caller's. Means are taken over valid entries;
// where none is valid the loss is 0, still connected to its input.
#pragma once

#include <torch/types.h>

#include "libeditnerf/geometry/camera_tensors.h"

namespace editnerf {

// Mean squared error of rgb [R, 3] against target [R, 3], plus that of rgb_coarse where it is defined. Rays count for
// `emphasis` [R]; undefined: all for 1.
torch::Tensor ReconstructionLoss(const torch::Tensor& rgb, const torch::Tensor& rgb_coarse, const torch::Tensor& target,
                                 const torch::Tensor& emphasis = {});

// P pairs of consecutive training frames t and t + 1 with their key points.
struct FramePairs {
  torch::Tensor frame;            // [P] int64, t as a row of cameras, flow and depth; t + 1 is the next row
  torch::Tensor key_points;       // [P, N, 3] in frame t, scene units
  torch::Tensor key_points_next;  // [P, N, 3] in frame t + 1
};

// L_motion: mean over pairs and key points of
//   || Pi_{t+1}(k_{t+1}) - Pi_t(k_t) - F_t^{t+1}(Pi_t(k_t)) ||^2 (reference_width / width)^2,
// squared pixels of an image reference_width wide. flow [F or F - 1, H, W, 2]: row t holds the flow from t to t + 1 in
// pixels of the cameras' images; not finite where unknown. Valid where both projections and the look-up are.
// Throws ShapeError, also unless the flow has the size of the cameras' images.
torch::Tensor MotionLoss(const CameraTensors& cameras, const torch::Tensor& flow, const FramePairs& pairs,
                         double reference_width);

// L_geo: mean over key points of || Phi_t(k_t) - D_t(Pi_t(k_t)) ||^2, squared scene units, averaged over the two frames
// of the pairs. depth [F, H, W]: distance from the camera centre, NaN where there is no surface. Throws as MotionLoss.
torch::Tensor GeometryLoss(const CameraTensors& cameras, const torch::Tensor& depth, const FramePairs& pairs);

// L_reg: mean over valid surface points of || x - T(x, beta_t) ||^2; both [R, 3] in scene units, valid [R] bool.
torch::Tensor WarpRegularisation(const torch::Tensor& x_observed, const torch::Tensor& x_canonical,
                                 const torch::Tensor& valid);

// Mean over all rays of || a ||^2 at their surface points, 0 where there is none, so that every ray's share is known
// before the others'; ambient [R, A], valid [R] bool.
torch::Tensor AmbientRegularisation(const torch::Tensor& ambient, const torch::Tensor& valid);

}  // namespace editnerf
