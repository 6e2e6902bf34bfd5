#include "libeditnerf/field/hyperspace_field.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/field/fast_hyperspace.h"
#include "libeditnerf/field/hyperspace_nerf.h"

namespace editnerf {
namespace {

torch::Tensor RowsOf(const torch::Tensor& table, const torch::Tensor& state, const char* name) {
  if (!table.defined()) Throw<ShapeError>("{}: this field needs them, and the frame states have none", name);
  return table.index_select(0, state);
}

torch::Tensor Lerp(const torch::Tensor& a, const torch::Tensor& b, double weight) {
  return a.defined() ? torch::lerp(a, b, weight) : a;
}

Bf16Unit ProductUnit(const std::string& kernel) {
  const Bf16Unit fastest = FastestBf16();
  if (kernel == "auto") return fastest == Bf16Unit::kTiles ? fastest : Bf16Unit::kNone;
  if (kernel != "bf16") return Bf16Unit::kNone;
  if (fastest == Bf16Unit::kNone) {
    Throw<ConfigError>("field.fast.kernel: 'bf16' needs a processor with AVX-512 BF16 or AMX; use 'auto' or 'fp32'");
  }
  return fastest;
}

std::shared_ptr<HyperspaceNetwork> MakeNetwork(const HyperspaceFieldOptions& options, int64_t ambient_dim) {
  const FieldConfig& config = options.config;
  const int64_t appearance_dim = config.HasAppearance() ? config.appearance_dim : 0;
  if (config.kind == "fast") {
    FastHyperspaceOptions fast;
    fast.config = config.fast;
    fast.box = options.box;
    fast.ambient_dim = ambient_dim;
    if (options.stage == FieldStage::kTrain) fast.num_key_points = options.num_key_points;
    fast.lamp = options.lamp;
    fast.use_direction = config.HasViewDirection();
    fast.appearance_dim = appearance_dim;
    return std::make_shared<FastHyperspace>(fast);
  }
  if (config.kind != "paper") Throw<ConfigError>("field.kind: expected 'paper' or 'fast', found '{}'", config.kind);
  HyperspaceInputs inputs;
  inputs.ambient_dim = ambient_dim;
  if (config.HasViewDirection()) inputs.direction_octaves = config.direction_octaves;
  inputs.appearance_dim = appearance_dim;
  return std::make_shared<HyperspaceNerfImpl>(config.nerf, inputs);
}

}  // namespace

FrameStates FrameStates::Interpolate(const FrameStates& a, const FrameStates& b, double weight) {
  return {Lerp(a.warp_code, b.warp_code, weight), Lerp(a.appearance_code, b.appearance_code, weight),
          Lerp(a.key_points, b.key_points, weight)};
}

HyperspaceField::HyperspaceField(const HyperspaceFieldOptions& options) : options_(options) {
  const FieldConfig& config = options_.config;
  const bool pretrain = options_.stage == FieldStage::kPretrain;
  const int64_t num_frames = options_.num_frames, num_key_points = options_.num_key_points;
  if (config.HasWarp()) warp_ = register_module("warp", WarpField(config.warp));
  if (config.HasWarp() || pretrain) {
    warp_codes_ = register_module("warp_codes", FrameCodes(num_frames, config.warp.code_dim, config.code_init));
  }
  if (config.HasAppearance()) {
    appearance_codes_ =
        register_module("appearance_codes", FrameCodes(num_frames, config.appearance_dim, config.code_init));
  }
  int64_t ambient_dim = 0;
  if (pretrain) {
    slicing_ = register_module("slicing", SlicingNetwork(config.slicing, config.warp.code_dim));
    ambient_dim = config.slicing.AmbientDim();
  } else if (num_key_points > 0) {
    if (options_.initial_tracks.defined()) {
      CheckShape(options_.initial_tracks, {num_frames, num_key_points, 3}, "initial key point tracks");
      key_points_ = KeyPointTable(options_.initial_tracks.to(torch::kFloat32));
    } else {
      key_points_ = KeyPointTable(num_frames, num_key_points);
    }
    register_module("key_points", key_points_);
    if (options_.initial_turns.defined()) {
      options_.local_frames = true;
      local_frames_ = LocalFrames(key_points_->ToLocal(options_.initial_tracks.to(torch::kFloat32)),
                                  UnwrapTurns(options_.initial_turns));
    } else if (options_.local_frames) {
      local_frames_ = LocalFrames(num_key_points);
    }
    if (local_frames_) register_module("local_frames", local_frames_);
    if (num_key_points > 1) {
      weights_ = register_module("weights", WeightNetwork(config.weights, num_key_points, options_.initial_tracks));
    }
    ambient_dim = 3;
  }
  options_.initial_tracks = options_.initial_turns = torch::Tensor();
  if (config.kind == "paper") coarse_ = register_module("coarse", MakeNetwork(options_, ambient_dim));
  fine_ = register_module("fine", MakeNetwork(options_, ambient_dim));
  SetStep(0);
}

bool HyperspaceField::has_rigid_anchor() const { return num_key_points() == 1 && !warp_; }

void HyperspaceField::SetStep(int64_t step) {
  const WarpFieldConfig& warp = options_.config.warp;
  warp_window_ = WindowAlpha(step, 0, warp.window_steps, warp.num_octaves);
  if (coarse_) coarse_->SetStep(step);
  fine_->SetStep(step);
}

FrameStates HyperspaceField::States(const torch::Tensor& time) {
  FrameStates states;
  if (warp_codes_) states.warp_code = warp_codes_->forward(time);
  if (appearance_codes_) states.appearance_code = appearance_codes_->forward(time);
  if (key_points_) states.key_points = key_points_->Positions(time);
  return states;
}

torch::Tensor HyperspaceField::LocalFramesOf(const torch::Tensor& key_points) {
  if (!local_frames_ || !key_points.defined()) return {};
  return local_frames_->forward(key_points_->ToLocal(key_points));
}

HyperspaceInput HyperspaceField::ToHyperspace(const FieldInput& input, const FrameStates& states, FieldOutput* output) {
  CheckShape(input.x_observed, {kAny, 3}, "field x_observed");
  CheckShape(input.state, {input.x_observed.size(0)}, "field state");
  torch::Tensor warp_code;
  if (warp_codes_) warp_code = RowsOf(states.warp_code, input.state, "warp codes");
  HyperspaceInput inner;
  inner.x_canonical = warp_ ? warp_->forward(input.x_observed, warp_code, warp_window_) : input.x_observed;
  if (slicing_) {
    inner.ambient = slicing_->forward(input.x_observed, warp_code);
  } else if (key_points_) {
    if (!states.key_points.defined()) {
      Throw<ShapeError>("key points: this field needs them, and the frame states have none");
    }
    CheckShape(states.key_points, {kAny, num_key_points(), 3}, "field key points");
    if (weights_) output->weights = weights_->forward(inner.x_canonical);
    output->anchor = WeightedKeyPoint(output->weights, states.key_points, input.state);
    inner.weights = output->weights;
    inner.local = inner.x_canonical - output->anchor;
    if (local_frames_) {
      inner.local = InLocalFrames(inner.x_canonical, output->weights, states.key_points,
                                  LocalFramesOf(states.key_points), input.state);
    }
    inner.ambient = WeightedKeyPoint(output->weights, key_points_->ToLocal(states.key_points), input.state);
  }
  output->x_canonical = inner.x_canonical;
  output->ambient = inner.ambient;
  return inner;
}

FieldOutput HyperspaceField::Evaluate(const FieldInput& input, const FrameStates& states, Level level) {
  FieldOutput output;
  HyperspaceInput inner = ToHyperspace(input, states, &output);
  if (options_.config.HasViewDirection()) inner.direction = input.direction;
  if (appearance_codes_) inner.appearance = RowsOf(states.appearance_code, input.state, "appearance codes");
  if (has_shade()) {
    const torch::Tensor& casters = states.casters.defined() ? states.casters : states.key_points;
    CheckShape(casters, {kAny, num_key_points(), 3}, "field casters");
    inner.from_keys = (inner.x_canonical.unsqueeze(1) - casters.index_select(0, input.state)).detach();
  }
  const HyperspaceOutput result = (level == Level::kCoarse && coarse_ ? coarse_ : fine_)->Evaluate(inner);
  output.density = result.density;
  output.radiance = result.radiance;
  return output;
}

FieldOutput HyperspaceField::EvaluateDensity(const FieldInput& input, const FrameStates& states, Level level) {
  FieldOutput output;
  const HyperspaceInput inner = ToHyperspace(input, states, &output);
  output.density = (level == Level::kCoarse && coarse_ ? coarse_ : fine_)->Density(inner);
  return output;
}

std::optional<FusedField> HyperspaceField::Fused() const {
  const auto* const fast = dynamic_cast<const FastHyperspace*>(fine_.get());
  if (fast == nullptr || warp_ || options_.config.fast.kernel == "modules") return std::nullopt;
  FusedField field;
  fast->AddTo(&field);
  if (slicing_ && !slicing_->AddTo(&field)) return std::nullopt;
  if (key_points_) {
    field.num_key_points = num_key_points();
    field.key_scale = key_points_->scale;
    field.key_offset = key_points_->offset;
    field.local_frames = has_local_frames();
  }
  if (weights_) weights_->AddTo(&field);
  if (!CanFuse(field)) return std::nullopt;
  field.bf16 = ProductUnit(options_.config.fast.kernel);
  return field;
}

}  // namespace editnerf
