// The field of one stage, put together from its parts (radiance_field.h has the formulas).
#pragma once

#include <torch/types.h>

#include <memory>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/field/frame_codes.h"
#include "libeditnerf/field/hyperspace_network.h"
#include "libeditnerf/field/key_points.h"
#include "libeditnerf/field/local_frames.h"
#include "libeditnerf/field/radiance_field.h"
#include "libeditnerf/field/slicing_network.h"
#include "libeditnerf/field/warp_field.h"
#include "libeditnerf/field/weight_network.h"
#include "libeditnerf/geometry/box.h"

namespace editnerf {

struct HyperspaceFieldOptions {
  FieldConfig config;
  FieldStage stage = FieldStage::kTrain;
  int64_t num_frames = 0;        // T training frames
  Box box;                       // of the scene, scene units
  int64_t num_key_points = 0;    // N, training only; 0: a static scene
  torch::Tensor initial_tracks;  // [T, N, 3], scene units; undefined: to be loaded from a checkpoint
  torch::Tensor initial_turns;  // [T, N, 3], rotation vectors from the parts' own axes to the scene's; may be undefined
  std::optional<Vec3> lamp;     // towards the lamp, unit length, scene axes; where it is known, or as loaded
  bool local_frames = false;    // parts turn, which `initial_turns` says, or the checkpoint to be loaded
};

class HyperspaceField : public RadianceField {
 public:
  // Throws ConfigError or ShapeError for options that do not fit together.
  explicit HyperspaceField(const HyperspaceFieldOptions& options);

  void SetStep(int64_t step) override;
  bool has_coarse_level() const override { return coarse_ != nullptr; }
  FrameStates States(const torch::Tensor& time) override;
  FieldOutput Evaluate(const FieldInput& input, const FrameStates& states, Level level) override;
  FieldOutput EvaluateDensity(const FieldInput& input, const FrameStates& states, Level level) override;

  // The fast field without warp, in float32 on the CPU: everything that configs/fast.yaml makes. The paper's networks,
  // a warp field, other devices and other types go module by module, which is also what the kernels are tested against.
  std::optional<FusedField> Fused() const override;

  const HyperspaceFieldOptions& options() const { return options_; }
  int64_t num_key_points() const { return options_.stage == FieldStage::kTrain ? options_.num_key_points : 0; }
  KeyPointTable key_points() { return key_points_; }  // empty in pretraining
  bool has_local_frames() const { return !local_frames_.is_empty(); }
  bool has_shade() const { return !weights_.is_empty() && options_.config.HasShade(); }
  LocalFrames local_frames() const { return local_frames_; }  // empty where nothing turns
  torch::Tensor LocalFramesOf(const torch::Tensor& key_points) override;

  // Whether key points alone decide where a part's own coordinates lie: one key point and no warp field.
  bool has_rigid_anchor() const;

 private:
  HyperspaceInput ToHyperspace(const FieldInput& input, const FrameStates& states, FieldOutput* output);

  HyperspaceFieldOptions options_;
  double warp_window_ = 0;
  WarpField warp_{nullptr};
  FrameCodes warp_codes_{nullptr}, appearance_codes_{nullptr};
  SlicingNetwork slicing_{nullptr};
  KeyPointTable key_points_{nullptr};
  LocalFrames local_frames_{nullptr};
  WeightNetwork weights_{nullptr};
  std::shared_ptr<HyperspaceNetwork> coarse_, fine_;
};

}  // namespace editnerf
