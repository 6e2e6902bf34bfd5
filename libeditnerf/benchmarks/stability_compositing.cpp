// Compositing: weights of samples and the light behind them, against products in extended precision.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/kernels/packed_compositing.h"
#include "libeditnerf/kernels/tile_functions.h"
#include "libeditnerf/render/compositing.h"

namespace editnerf {
namespace {

constexpr int64_t kSamples = 4096;  // of a ray; a multiple of what LightAlongRays takes at a time
// Weights are compared relative to themselves down to here. Kernels end at e^-80 = 2e-35: beyond, nothing is seen.
constexpr double kFaintest = 1e-28;
// x reaches 64 where the faintest weights lie, so that exp(-x) is off by 64 roundings of x, and some of its own; and x
// is a sum in double of all samples, whatever the tensors' type.
double BoundOf(const Precision& precision) {
  return 256 * precision.rounding + 64 * kSamples * Precisions().front().rounding;
}

struct Rays {
  std::string name;
  torch::Tensor density, delta;  // [R, S] float64
};

// The loss that is differentiated: factors of weights [R, S], and of transparency and opacity.
struct Loss {
  torch::Tensor weights;
  double transparency = 0.7, opacity = -0.4;
};

struct Composited {
  torch::Tensor weights, ends, gradient;  // [R, S], [R, 2]: transparency and opacity, [R, S] with respect to density
};

std::vector<Rays> AllRays() {
  torch::manual_seed(1);
  const auto options = torch::kFloat64;
  const auto exponents = torch::linspace(-12, 12, 25, options).unsqueeze(1);
  std::vector<Rays> all;
  const auto add = [&all](const char* name, const torch::Tensor& density, const torch::Tensor& delta) {
    all.push_back({name, density.contiguous(), delta.expand_as(density).contiguous()});
  };
  add("equal, 1e-12 to 1e12", torch::pow(10.0, exponents).expand({25, kSamples}) / 0.02,
      torch::full({1}, 0.02, options));
  add("mixed, 1e-12 to 1e12", torch::pow(10.0, torch::rand({16, kSamples}, options) * 24 - 12),
      torch::ones({1}, options));
  auto opaque = torch::full({4, kSamples}, 1e-5, options);
  for (int64_t r = 0; r < 4; ++r) opaque[r][r * (kSamples - 1) / 3] = 1e12;
  add("one opaque among thin", opaque, torch::ones({1}, options));
  add("all zero", torch::zeros({2, kSamples}, options), torch::ones({1}, options));
  add("alternating 0, 1e12, 0, 1e-12", torch::tensor({0.0, 1e12, 0.0, 1e-12}, options).repeat({2, kSamples / 4}),
      torch::ones({1}, options));
  const auto thin = torch::tensor({0.0, 1e-12, 1e-6, 0.0}, options).repeat({2, kSamples / 4});
  add("thin and coincident", torch::pow(10.0, torch::rand({2, kSamples}, options) * 6), thin);
  return all;
}

// Light is multiplied on from sample to sample, never the exponential of a sum; and the gradient goes from the back to
// the front: with C_i what is seen from sample i on, dL/dtau_i = T_{i+1} (g_i - C_{i+1}). Nothing cancels.
Composited Expected(const torch::Tensor& density, const torch::Tensor& delta, const Loss& loss) {
  Composited expected = {torch::empty_like(density), torch::empty({density.size(0), 2}, torch::kFloat64),
                         torch::empty_like(density)};
  const int64_t count = density.size(1);
  for (int64_t r = 0; r < density.size(0); ++r) {
    const auto *const sigma = density.data_ptr<double>() + r * count,
                      *const length = delta.data_ptr<double>() + r * count,
                      *const g = loss.weights.data_ptr<double>() + r * count;
    auto *const weight = expected.weights.data_ptr<double>() + r * count, *const gradient =
                                                                              expected.gradient.data_ptr<double>() +
                                                                              r * count;
    std::vector<Real> alpha(static_cast<size_t>(count)), behind(alpha.size());
    Real light = 1, seen = 0;
    for (size_t i = 0; i < alpha.size(); ++i) {
      const Real tau = static_cast<Real>(sigma[i]) * static_cast<Real>(length[i]);
      alpha[i] = -std::expm1(-tau);
      weight[i] = static_cast<double>(light * alpha[i]);
      seen += light * alpha[i];
      light *= std::exp(-tau);
      behind[i] = light;
    }
    expected.ends[r][0] = static_cast<double>(light);
    expected.ends[r][1] = static_cast<double>(seen);
    Real from_here = static_cast<Real>(loss.transparency) - static_cast<Real>(loss.opacity);
    for (size_t i = alpha.size(); i-- > 0;) {
      gradient[i] = static_cast<double>(static_cast<Real>(length[i]) * behind[i] * (g[i] - from_here));
      from_here = alpha[i] * g[i] + (1 - alpha[i]) * from_here;
    }
  }
  return expected;
}

template <class Operator>
Composited Differentiated(const torch::Tensor& density, const Loss& loss, const Operator& composite) {
  const auto leaf = density.clone().requires_grad_(true);
  const auto [weights, transparency, opacity] = composite(leaf);
  const auto value = (weights * loss.weights.to(leaf.dtype())).sum() + loss.transparency * transparency.sum() +
                     loss.opacity * opacity.sum();
  return {weights.detach(), torch::stack({transparency, opacity}, 1).detach(),
          torch::autograd::grad({value}, {leaf})[0]};
}

Composited ByLibTorch(const torch::Tensor& density, const torch::Tensor& delta, const Loss& loss) {
  return Differentiated(density, loss, [&](const torch::Tensor& leaf) {
    const RayWeights rays = ComputeRayWeights(leaf, delta, false);
    return std::make_tuple(rays.weights, rays.transparency, rays.opacity);
  });
}

Composited Packed(const torch::Tensor& density, const torch::Tensor& delta, const Loss& loss) {
  const auto offsets = torch::arange(density.size(0) + 1, torch::kInt64) * density.size(1);
  return Differentiated(density, loss, [&](const torch::Tensor& leaf) {
    const PackedPicture picture = CompositePacked(leaf.flatten(), delta.flatten(), offsets);
    return std::make_tuple(picture.weights.view(leaf.sizes()), picture.transparency, picture.opacity);
  });
}

// As the fused pass has it: thickness is summed in double, light and weights are found in float32.
torch::Tensor FusedWeights(const torch::Tensor& density, const torch::Tensor& delta) {
  const auto tau = (density * delta).contiguous();
  const auto earlier = tau.narrow(1, 0, tau.size(1) - 1).to(torch::kFloat64).cumsum(1);
  const auto before = torch::cat({torch::zeros({tau.size(0), 1}), earlier.to(torch::kFloat32)}, 1).contiguous();
  auto light = torch::empty_like(tau), weights = torch::empty_like(tau);
  for (int64_t r = 0; r < tau.size(0); ++r) {
    LightAlongRays(tau[r].data_ptr<float>(), before[r].data_ptr<float>(), tau.size(1), light[r].data_ptr<float>(),
                   weights[r].data_ptr<float>());
  }
  return weights;
}

StabilityRow RowOf(const std::string& name, const std::string& variant, double bound, const Composited& found,
                   const Composited& expected) {
  StabilityRow row = {"compositing", name, variant, {}, ErrorAndBound{}, true};
  row.value = {std::max(LargestRelativeError(found.weights, expected.weights, kFaintest),
                        LargestRelativeError(found.ends, expected.ends, kFaintest)),
               bound};
  row.gradient = {LargestErrorOfRows(found.gradient, expected.gradient, kFaintest), bound};
  row.finite = AllFinite({found.weights, found.ends, found.gradient});
  return row;
}

}  // namespace

StabilityRows CompositingStability() {
  StabilityRows rows;
  for (const Rays& rays : AllRays()) {
    const Loss loss = {torch::rand(rays.density.sizes(), torch::kFloat64)};
    for (const Precision& precision : Precisions()) {
      const auto density = rays.density.to(precision.type), delta = rays.delta.to(precision.type);
      const auto expected = Expected(density.to(torch::kFloat64), delta.to(torch::kFloat64), loss);
      rows.push_back(RowOf(rays.name, "LibTorch " + precision.name, BoundOf(precision),
                           ByLibTorch(density, delta, loss), expected));
      rows.push_back(
          RowOf(rays.name, "packed " + precision.name, BoundOf(precision), Packed(density, delta, loss), expected));
      if (precision.type != torch::kFloat32) continue;
      ForEachInstructionSet([&](const std::string& target) {
        const auto weights = FusedWeights(density, delta);
        rows.push_back({"compositing",
                        rays.name,
                        "fused " + target,
                        {LargestRelativeError(weights, expected.weights, kFaintest), BoundOf(precision)},
                        std::nullopt,
                        AllFinite({weights})});
      });
    }
  }
  return rows;
}

}  // namespace editnerf
