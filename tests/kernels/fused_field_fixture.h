// A small random HyperspaceField and rays for it, and the same objective differentiated both ways: module by module,
// and by the fused kernels.
#pragma once

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <map>
#include <string>

#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/render/ray_renderer.h"
#include "libeditnerf/training/losses.h"
#include "tests/catch.h"

namespace editnerf {

inline const Box kBox{{-1, -0.8, -0.6}, {1, 0.9, 1.2}};
constexpr double kNear = 0.2, kFar = 3.0;
constexpr int64_t kFrames = 5;

struct Setting {
  FieldStage stage = FieldStage::kTrain;
  int64_t key_points = 1;
  bool appearance = false, direction = true;
  double early_stop = 0.02;
  int64_t rays = 33;
  int64_t steps = 24;
  double density_bias = 0.5;
  bool start = false;  // rays that begin on their way
  int64_t window_steps = 0, step = 1000000;
  bool shade = false;
  bool turning = false;  // parts that turn as their key points move
  std::string kernel = "fp32";
  Box box = kBox;
  double near = kNear, far = kFar;
};

inline HyperspaceFieldOptions OptionsFor(const Setting& setting) {
  HyperspaceFieldOptions options;
  FieldConfig& config = options.config;
  config.kind = "fast";
  config.warp.enabled = Choice::kOff;
  config.use_appearance = setting.appearance ? Choice::kOn : Choice::kOff;
  config.use_view_direction = setting.direction ? Choice::kOn : Choice::kOff;
  config.code_init = 0.5;
  config.slicing.num_octaves = 3, config.slicing.depth = 2, config.slicing.width = 24, config.slicing.skip_layer = 0;
  config.slicing.output_init = 0.3;
  config.weights.num_octaves = 3, config.weights.depth = 2, config.weights.width = 20;
  config.weights.output_init = 0.3, config.weights.distance_prior = 2;
  HashEncodingConfig& hash = config.fast.canonical_hash;
  hash.num_levels = 5, hash.log2_table_size = 10, hash.base_resolution = 4, hash.finest_resolution = 40;
  config.fast.local_hash = hash;
  config.fast.local_hash.num_levels = 4;
  config.fast.shade = setting.shade;
  config.fast.shade_hash = {3, 2, 10, 4, 20};
  config.fast.kernel = setting.kernel;
  config.fast.width = 40;
  config.fast.local_window_steps = setting.window_steps;
  config.fast.density_bias = setting.density_bias;
  options.stage = setting.stage;
  options.num_frames = kFrames;
  options.box = setting.box;
  if (setting.stage == FieldStage::kTrain && setting.key_points > 0) {
    options.num_key_points = setting.key_points;
    options.initial_tracks = torch::rand({kFrames, setting.key_points, 3}) - 0.5;
    if (setting.key_points > 2) options.lamp = Normalized({0.3, -0.5, 0.8});
    if (setting.turning) options.initial_turns = 2 * torch::rand({kFrames, setting.key_points, 3}) - 1;
  }
  return options;
}

inline std::shared_ptr<HyperspaceField> MakeField(const Setting& setting) {
  auto field = std::make_shared<HyperspaceField>(OptionsFor(setting));
  const torch::NoGradGuard no_grad;
  for (const auto& item : field->named_parameters()) {
    // Features of any size, so that everything matters.
    if (item.key().find("_table") != std::string::npos) item.value().uniform_(-1, 1);
    if (item.key().find("bias") != std::string::npos) item.value().uniform_(-0.3, 0.3);
  }
  field->SetStep(setting.step);
  return field;
}

inline RenderConfig ConfigFor(const Setting& setting) {
  RenderConfig config;
  config.sampler = "occupancy";
  config.march_steps = setting.steps;
  config.occupancy_resolution = 8;
  config.early_stop = setting.early_stop;
  return config;
}

inline RayRenderer MakeRenderer(const HyperspaceField& field, const Setting& setting) {
  std::optional<Box> local_box;
  if (field.has_rigid_anchor()) local_box = Box{{-2, -2, -2}, {2, 2, 2}};
  return RayRenderer(ConfigFor(setting), setting.near, setting.far, setting.box, local_box);
}

// Random backgrounds, jitter and known distances.
inline RayOptions RandomOptions(int64_t rays) {
  RayOptions options;
  options.training = options.distortion = true;
  options.background = torch::rand({rays, 3});
  options.jitter = torch::rand({rays});
  options.distance = torch::rand({rays}) * (kFar - kNear) + kNear;
  options.tolerance = torch::rand({rays}) * 0.1;
  return options;
}

inline RayBatch RandomRays(int64_t count) {
  RayBatch rays;
  rays.origin = torch::rand({count, 3}) - torch::tensor({0.5F, 0.5F, 2.0F});
  const auto toward = torch::rand({count, 3}) - 0.5 - rays.origin;
  rays.direction = toward / toward.norm(2, -1, true);
  rays.state = torch::randint(kFrames, {count}, torch::kInt64);
  return rays;
}

// One ray that stays in kBox, so that it has a sample for each of the setting's steps.
inline RayBatch RayInside() {
  RayBatch rays;
  rays.origin = torch::tensor({{-0.9F, -0.7F, -0.5F}});
  const auto toward = torch::tensor({{0.9F, 0.8F, 1.1F}}) - rays.origin;
  rays.direction = toward / toward.norm(2, -1, true);
  rays.state = torch::randint(kFrames, {1}, torch::kInt64);
  return rays;
}
constexpr double kFarInside = 2.8;

inline RayObjective ObjectiveFor(const Setting& setting) {
  RayObjective objective;
  objective.target = torch::rand({setting.rays, 3});
  objective.distortion = 0.3;
  objective.depth = 0.4;
  if (setting.stage == FieldStage::kPretrain) objective.ambient = 0.2;
  return objective;
}

using Gradients = std::map<std::string, torch::Tensor>;

inline Gradients GradientsOf(HyperspaceField& field) {
  Gradients gradients;
  for (const auto& item : field.named_parameters()) {
    gradients[item.key()] =
        item.value().grad().defined() ? item.value().grad().clone() : torch::zeros_like(item.value());
    item.value().mutable_grad() = torch::Tensor();
  }
  return gradients;
}

struct Found {
  double reconstruction, distortion, ambient, depth;
  int64_t samples;
  Gradients gradients;
};

// With an even number of key points their shade is cast from where they are in another frame.
inline FrameStates AllStates(HyperspaceField& field) {
  FrameStates states = field.States(torch::arange(kFrames, torch::kInt64));
  if (field.has_shade() && field.num_key_points() % 2 == 0) states.casters = states.key_points.detach().flip(0);
  return states;
}

inline Found ModuleByModule(HyperspaceField& field, RayRenderer& renderer, RayBatch rays, RayOptions options,
                            RayObjective objective, torch::Dtype type) {
  field.to(type);
  for (torch::Tensor* const tensor :
       {&rays.origin, &rays.direction, &options.background, &options.jitter, &options.distance, &options.tolerance,
        &options.start, &objective.target, &objective.emphasis}) {
    if (!tensor->defined()) continue;
    *tensor = tensor->to(type);
  }
  const RayResult result = renderer.Render(field, rays, AllStates(field), options);
  auto total = ReconstructionLoss(result.rgb, {}, objective.target, objective.emphasis);
  Found found = {total.item<double>(), 0, 0, 0, result.samples, {}};
  const auto depth = objective.depth * result.depth_miss;
  found.depth = depth.item<double>();
  total = total + depth;
  const auto distortion = objective.distortion * result.distortion.mean();
  found.distortion = distortion.item<double>();
  total = total + distortion;
  if (objective.ambient > 0) {
    const auto ambient = objective.ambient * AmbientRegularisation(result.ambient, result.depth_valid);
    found.ambient = ambient.item<double>();
    total = total + ambient;
  }
  total.backward();
  found.gradients = GradientsOf(field);
  field.to(torch::kFloat32);
  return found;
}

inline Found Fused(HyperspaceField& field, RayRenderer& renderer, const RayBatch& rays, const RayOptions& options,
                   const RayObjective& objective) {
  const FrameStates states = AllStates(field);
  const auto result = renderer.AddGradients(field, rays, states, options, objective);
  REQUIRE(result.has_value());
  for (const auto table : {&FrameStates::key_points, &FrameStates::warp_code, &FrameStates::appearance_code}) {
    REQUIRE((states.*table).defined() == (result->states.*table).defined());
    if ((states.*table).defined()) (states.*table).backward(result->states.*table);
  }
  return {result->reconstruction, result->distortion, result->ambient,
          result->depth,          result->samples,    GradientsOf(field)};
}

// A ray that has as many samples as the setting has steps.
inline Setting OneRay(int64_t samples, int64_t key_points) {
  Setting setting;
  setting.rays = 1;
  setting.steps = samples;
  setting.far = kFarInside;
  setting.early_stop = 0;
  setting.key_points = key_points;
  return setting;
}

inline double RelativeDifference(const torch::Tensor& found, const torch::Tensor& expected) {
  return (found - expected).norm().item<double>() / std::max(expected.norm().item<double>(), 1e-9);
}

// Every gradient within 1e-5 of the exact one, in float64 (3e-5 where sums cancel), or no farther than twice
// what the expected one, in float32, is off.
inline void CheckGradients(const Gradients& found, const Gradients& expected, const Gradients& exact) {
  for (const auto& [name, gradient] : expected) {
    INFO(name);
    // Where a sum cancels, as before a softmax, float32 is no better in the reference either; and what a bias sums is
    // as large as what its layer's weights sum.
    const double rounding = RelativeDifference(gradient, exact.at(name));
    double size = gradient.norm().item<double>();
    if (const auto at = name.rfind(".bias"); at != std::string::npos) {
      size = std::max(size, expected.at(name.substr(0, at) + ".weight").norm().item<double>());
    }
    const double difference = (found.at(name).to(torch::kFloat64) - exact.at(name)).norm().item<double>();
    // What reaches the weights is a small difference of what their key points would get, each in a frame of its own;
    // and all samples' pulls on a key point add up to little.
    const bool of_weights = name.rfind("weights.", 0) == 0;
    const bool of_key_points = name.rfind("key_points.", 0) == 0 || name.rfind("local_frames.", 0) == 0;
    const double allowed = of_weights || of_key_points ? 3e-5 : 1e-5;
    CHECK(difference <= std::max(allowed, 2 * rounding) * size);
  }
}

}  // namespace editnerf
