// The field of one stage: warp, ambient coordinates and hyperspace network put together.
//
//   pretraining (HyperNeRF):   x' = T(x, beta_t),  a = S(x, beta_t),        (c, sigma) = H(x' (+) a, d, alpha_t)
//   training (EditableNeRF):   x' = T(x, beta_t),  p = sum_i w^i(x') k_t^i,  (c, sigma) = H(x' (+) p, d, alpha_t)
//
// EditableNeRF (Zheng et al., CVPR 2023), eq. (1) to (4). H is either the paper's pair of networks (coarse and fine) or
// the fast field over two hash encodings; the rest is shared. What the configuration leaves out is not built.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <optional>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/kernels/fused_field.h"

namespace editnerf {

// The states of F frames (or edits) that the samples of a batch refer to. Tensors that a field has no use for are
// undefined.
struct FrameStates {
  torch::Tensor warp_code;        // [F, Dw]
  torch::Tensor appearance_code;  // [F, Da]
  torch::Tensor key_points;       // [F, N, 3], scene units
  // [F, N, 3], where the parts are that cast shade, no gradient; undefined: at key_points, as in every picture.
  // Training shows what stands still with its parts in one place and their shade in another (training/drawn_states.h).
  torch::Tensor casters{};

  // (1 - weight) * a + weight * b, row by row.
  static FrameStates Interpolate(const FrameStates& a, const FrameStates& b, double weight);
};

struct FieldInput {
  torch::Tensor x_observed;  // [S, 3], scene units
  torch::Tensor direction;   // [S, 3], unit length; may be undefined for Density
  torch::Tensor state;       // [S] int64, row of FrameStates
};

struct FieldOutput {
  torch::Tensor density;      // [S], per scene unit, >= 0
  torch::Tensor radiance;     // [S, 3], in [0, 1]; undefined from Density
  torch::Tensor x_canonical;  // [S, 3], scene units
  torch::Tensor ambient;      // [S, A]: a in pretraining, p in local coordinates in training
  torch::Tensor anchor;       // [S, 3]: p in scene units; undefined in pretraining
  torch::Tensor weights;      // [S, N]; undefined in pretraining and for N = 1
};

enum class Level { kCoarse, kFine };
enum class FieldStage { kPretrain, kTrain };

// What renderers and trainers ask of a field, whatever it is made of.
class RadianceField : public torch::nn::Module {
 public:
  // Coarse-to-fine windows are functions of the optimisation step.
  virtual void SetStep(int64_t step) = 0;

  // Whether Level::kCoarse is a network of its own (the paper's pair); otherwise both levels are the same.
  virtual bool has_coarse_level() const = 0;

  // Differentiable rows of the per-frame tables; `time` [F] int64 indexes the training frames in time order.
  virtual FrameStates States(const torch::Tensor& time) = 0;

  // Throws ShapeError unless the shapes are those of FieldInput and FrameStates.
  virtual FieldOutput Evaluate(const FieldInput& input, const FrameStates& states, Level level) = 0;

  // The same without radiance: cheaper, and `input.direction` is not read.
  virtual FieldOutput EvaluateDensity(const FieldInput& input, const FrameStates& states, Level level) = 0;

  // Local frames of key points [F, N, 3]: R [F, N, 3, 3] from scene axes to each part's own, differentiable; undefined
  // where parts do not turn.
  virtual torch::Tensor LocalFramesOf(const torch::Tensor& /*key_points*/) { return {}; }

  // The same field as data for the fused kernels (kernels/fused_field.h), or nothing where it has to be evaluated
  // module by module. Renderers and the trainer ask here, and nowhere else, which of the two ways to go.
  virtual std::optional<FusedField> Fused() const { return std::nullopt; }
};

// What the fused kernels read of the states, with the field's local frames of their key points.
inline FusedStates FusedStatesOf(const FrameStates& states, const torch::Tensor& local_frames) {
  return {states.key_points, local_frames, states.warp_code, states.appearance_code, states.casters};
}

inline FusedStates FusedStatesOf(RadianceField& field, const FrameStates& states) {
  return FusedStatesOf(states, field.LocalFramesOf(states.key_points));
}

}  // namespace editnerf
