// The fused pass from the march to the gradients of log densities, ray by ray. Samples lie exactly on the corners of a
// hash level, and both networks are a single layer, so that every sample has an entry of the table to itself: its
// features are the sample's log density and what its colour is made of.
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/kernels/hash_index.h"

namespace editnerf {
namespace {

constexpr int64_t kSteps = 64, kRays = 48, kTableSize = 1 << 19;
constexpr double kTargets[3] = {0.25, 0.5, 0.75};

// Gradients are compared with the largest of their ray, however small that is: a ray whose first sample is opaque has
// none but e^-tau. They are differences of what colours and places pull at, which float32 knows to 6e-8 each: where
// these happen to be nearly alike, three digits are left.
constexpr double kFaintest = 1e-28, kGradientBound = 1e-3;

struct Logs {
  std::string name;
  torch::Tensor density;  // [R, kSteps] float32, logarithms within the clamp
};

// What is asked of the rays beside their colours.
struct Objective {
  std::string name;
  bool background = false;  // a colour of its own behind every ray
  double distortion = 0, depth = 0;
};

std::vector<Objective> AllObjectives() {
  return {{"fused pass", false, 0, 0},
          {"fused pass, background", true, 0, 0},
          {"fused pass, distortion", false, 0.5, 0},
          {"fused pass, depth", false, 0, 0.5},
          {"fused pass, all objectives", true, 0.5, 0.5}};
}

struct Shaded {
  torch::Tensor rgb, gradient;  // [R, 3], [R, kSteps] with respect to log density
};

std::vector<Logs> AllLogs() {
  torch::manual_seed(9);
  const auto rising = torch::linspace(-15, 15, kRays).unsqueeze(1).expand({kRays, kSteps}).contiguous();
  auto opaque = torch::full({kRays, kSteps}, -9.0F);
  for (int64_t r = 0; r < kRays; ++r) opaque[r][r % kSteps] = 15;
  const auto alternating = torch::tensor({-15.0F, 15.0F, -15.0F, 0.0F}).repeat({kRays, kSteps / 4});
  return {{"equal, e^-15 to e^15", rising},
          {"mixed, e^-15 to e^15", torch::rand({kRays, kSteps}) * 30 - 15},
          {"one opaque among thin", opaque},
          {"alternating e^-15, e^15, 1", alternating}};
}

int64_t EntryOf(int64_t ray, int64_t step) {
  const hash_index::Level level(kSteps, kTableSize);
  return level.Entry(static_cast<uint32_t>(step), level.Row(static_cast<uint32_t>(ray), 7));
}

struct Scene {
  explicit Scene(const torch::Tensor& log_density) {
    features = torch::rand({kRays, kSteps}) * 4 - 2;
    field.canonical.table = torch::zeros({1, kTableSize, 2});
    field.canonical.resolutions = {kSteps};
    field.low = {0, 0, 0};
    field.density = {{torch::eye(2)}, {torch::zeros({2})}, true};
    field.color = {{torch::tensor({{1.0F}, {-0.5F}, {0.25F}})}, {torch::tensor({0.0F, 0.5F, -0.5F})}, true};
    auto* const table = field.canonical.table.data_ptr<float>();
    origin = torch::empty({kRays, 3});
    for (int64_t r = 0; r < kRays; ++r) {
      const float at[3] = {0, static_cast<float>(r) / kSteps, 7.0F / kSteps};
      std::copy_n(at, 3, origin.data_ptr<float>() + 3 * r);
      for (int64_t i = 0; i < kSteps; ++i) {
        table[2 * EntryOf(r, i)] = log_density.data_ptr<float>()[r * kSteps + i];
        table[2 * EntryOf(r, i) + 1] = features.data_ptr<float>()[r * kSteps + i];
      }
    }
    grid = MarchedGrid({torch::full({3}, -0.5, torch::kFloat64), torch::full({3}, 1.5, torch::kFloat64), occupied, 1});
    rays.count = kRays;
    rays.origin = origin.data_ptr<float>(), rays.direction = direction.data_ptr<float>();
    rays.jitter = jitter.data_ptr<float>(), rays.state = state.data_ptr<int64_t>();
    rays.grid = &grid;
    rays.steps = MarchedSteps(0, 1, kSteps);
    rays.delta = 1.0F / kSteps;
  }

  torch::Tensor features, origin;  // [R, kSteps], [R, 3]
  torch::Tensor direction = torch::tensor({1.0F, 0.0F, 0.0F}).repeat({kRays, 1}), jitter = torch::zeros({kRays});
  torch::Tensor state = torch::zeros({kRays}, torch::kInt64), occupied = torch::ones({1}, torch::kBool);
  torch::Tensor target = torch::tensor({0.25F, 0.5F, 0.75F}).repeat({kRays, 1});
  torch::Tensor background = torch::rand({kRays, 3});
  // Every fourth ray's distance is unknown.
  torch::Tensor distance = torch::tensor({0.3F, 0.5F, 0.9F, NAN}).repeat({kRays / 4}),
                tolerance = torch::full({kRays}, 0.05F);
  FusedField field;
  MarchedGrid grid;
  BundledRays rays;
};

Shaded Found(Scene& scene, const Objective& objective) {
  FusedStates states;
  const FieldKernel kernel(scene.field, states);
  FusedRays fused;
  Shaded found = {torch::empty({kRays, 3}), torch::empty({kRays, kSteps})};
  const auto opacity = torch::empty({kRays}), depth = torch::empty({kRays}),
             valid = torch::empty({kRays}, torch::kBool);
  RayPicture picture;
  picture.rgb = found.rgb.data_ptr<float>();
  picture.opacity = opacity.data_ptr<float>(), picture.depth = depth.data_ptr<float>();
  picture.depth_valid = valid.data_ptr<bool>();
  if (objective.background) picture.background = scene.background.data_ptr<float>();
  fused.Show(kernel, scene.rays, picture);
  scene.field.canonical.table.mutable_grad() = torch::Tensor();
  RayLoss loss;
  loss.target = scene.target.data_ptr<float>();
  if (objective.background) loss.background = scene.background.data_ptr<float>();
  loss.distortion = objective.distortion;
  if (objective.depth > 0) {
    loss.distance = scene.distance.data_ptr<float>(), loss.tolerance = scene.tolerance.data_ptr<float>();
    loss.depth = objective.depth;
  }
  fused.AddGradients(kernel, scene.rays, loss, &states);
  const auto gradient = scene.field.canonical.table.grad().contiguous();
  for (int64_t r = 0; r < kRays; ++r) {
    for (int64_t i = 0; i < kSteps; ++i) {
      found.gradient.data_ptr<float>()[r * kSteps + i] = gradient.data_ptr<float>()[2 * EntryOf(r, i)];
    }
  }
  return found;
}

// dL/dw_i of distortion and depth, which want nothing of the colours; pairs of samples one by one, where the kernels
// have running sums.
void AddPullOfPlaces(const Objective& objective, const Scene& scene, int64_t ray, const Real* weight, Real* pull) {
  const Real distance = scene.distance.data_ptr<float>()[ray], tolerance = scene.tolerance.data_ptr<float>()[ray];
  for (int64_t i = 0; i < kSteps; ++i) {
    Real apart = weight[i] / (3 * kSteps);
    for (int64_t j = 0; j < kSteps; ++j) apart += weight[j] * std::abs(static_cast<Real>(i - j)) / kSteps;
    pull[i] += static_cast<Real>(objective.distortion) * 2 * apart / kRays;
    if (objective.depth == 0 || std::isnan(distance)) continue;
    const Real miss = std::abs(static_cast<Real>(i) / kSteps - distance) / distance - tolerance;
    pull[i] += static_cast<Real>(objective.depth) * std::max<Real>(0, miss) / kRays;
  }
}

// As in stability_compositing.cpp: light multiplied on, gradients from the back to the front.
Shaded Expected(const Scene& scene, const Objective& objective, const torch::Tensor& log_density) {
  Shaded expected = {torch::empty({kRays, 3}, torch::kFloat64), torch::zeros({kRays, kSteps}, torch::kFloat64)};
  const auto *const weight = scene.field.color.weights[0].data_ptr<float>(), *const bias = scene.field.color.biases[0]
                                                                                               .data_ptr<float>();
  for (int64_t r = 0; r < kRays; ++r) {
    Real tau[kSteps], behind[kSteps], absorbed[kSteps], pull[kSteps] = {}, light = 1, pull_of_end = 0;
    for (int64_t i = 0; i < kSteps; ++i) {
      tau[i] = std::exp(static_cast<Real>(log_density.data_ptr<float>()[r * kSteps + i])) / kSteps;
      absorbed[i] = -std::expm1(-tau[i]) * light;
      behind[i] = light *= std::exp(-tau[i]);
    }
    for (int64_t c = 0; c < 3; ++c) {
      const Real end = objective.background ? scene.background.data_ptr<float>()[3 * r + c] : 0;
      Real color[kSteps], seen = light * end;
      for (int64_t i = 0; i < kSteps; ++i) {
        const Real feature = scene.features.data_ptr<float>()[r * kSteps + i];
        color[i] = 1 / (1 + std::exp(-(weight[c] * feature + bias[c])));
        seen += absorbed[i] * color[i];
      }
      expected.rgb[r][c] = static_cast<double>(seen);
      const Real missed = 2 * (seen - kTargets[c]) / (3 * kRays);
      for (int64_t i = 0; i < kSteps; ++i) pull[i] += missed * color[i];
      pull_of_end += missed * end;
    }
    AddPullOfPlaces(objective, scene, r, absorbed, pull);
    Real from_here = pull_of_end;  // what a unit of light does from sample i + 1 on
    for (int64_t i = kSteps; i-- > 0;) {
      expected.gradient.data_ptr<double>()[r * kSteps + i] =
          static_cast<double>(tau[i] * behind[i] * (pull[i] - from_here));
      from_here = -std::expm1(-tau[i]) * pull[i] + std::exp(-tau[i]) * from_here;
    }
  }
  return expected;
}

}  // namespace

StabilityRows FusedPassStability() {
  StabilityRows rows;
  for (const Logs& logs : AllLogs()) {
    Scene scene(logs.density);
    for (const Objective& objective : AllObjectives()) {
      const Shaded expected = Expected(scene, objective, logs.density);
      ForEachInstructionSet([&](const std::string& target) {
        const Shaded found = Found(scene, objective);
        rows.push_back({objective.name,
                        logs.name,
                        target,
                        {LargestErrorOfRows(found.rgb, expected.rgb, kFaintest), 16 * SinglePrecision().rounding},
                        ErrorAndBound{LargestErrorOfRows(found.gradient, expected.gradient, kFaintest), kGradientBound},
                        AllFinite({found.rgb, found.gradient})});
      });
    }
  }
  return rows;
}

}  // namespace editnerf
