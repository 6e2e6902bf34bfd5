// The stiff limit of dT/ds = -sigma T: the colour of a ray through a bump of density, by several ways of stepping.
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/benchmarks/timing.h"
#include "libeditnerf/kernels/packed_compositing.h"
#include "libeditnerf/kernels/tile_functions.h"
#include "libeditnerf/render/compositing.h"

namespace editnerf {
namespace {

constexpr double kCenter = 0.5, kWidth = 0.08;  // of the bump, on a ray from 0 to 1
constexpr int64_t kSamplesAtOnce = 1 << 15;     // of all rays, where times are taken

Real ColorAt(Real s) { return static_cast<Real>(0.5) + static_cast<Real>(0.4) * std::cos(7 * s); }

// Threads that wait for each other would be counted too.
struct OneThread {
  OneThread() { SetNumThreads(1); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;
  ~OneThread() { SetNumThreads(before); }
  int64_t before = NumThreads();
};

// Optical thickness of the whole ray, and how much of it lies before s, in closed form.
struct Bump {
  Real thickness;

  Real Density(Real s) const {
    const Real u = (s - kCenter) / kWidth;
    return thickness * std::exp(-u * u / 2) / Normalisation();
  }
  Real Before(Real s) const {
    const Real scale = std::sqrt(static_cast<Real>(2)) * kWidth;
    return thickness * (std::erf((s - kCenter) / scale) - std::erf(-kCenter / scale)) / 2 / Share();
  }

 private:
  static Real Share() { return std::erf(kCenter / (std::sqrt(static_cast<Real>(2)) * kWidth)); }
  static Real Normalisation() { return kWidth * std::sqrt(2 * std::acos(static_cast<Real>(-1))) * Share(); }
};

// The integral of exp(-tau(s)) sigma(s) c(s) by Gauss and Legendre's rule of five points on fine intervals, with the
// closed form of tau. The colour behind the ray is black.
Real ExactColor(const Bump& bump) {
  constexpr int kIntervals = 20000;
  static const Real nodes[3] = {0, std::sqrt(5 - 2 * std::sqrt(static_cast<Real>(10) / 7)) / 3,
                                std::sqrt(5 + 2 * std::sqrt(static_cast<Real>(10) / 7)) / 3};
  const Real root = 13 * std::sqrt(static_cast<Real>(70));
  const Real weights[3] = {static_cast<Real>(128) / 225, (322 + root) / 900, (322 - root) / 900};
  const Real half = static_cast<Real>(0.5) / kIntervals;
  Real sum = 0;
  for (int i = 0; i < kIntervals; ++i) {
    const auto value = [&](Real node) {
      const Real s = half * (2 * i + 1 + node);
      return std::exp(-bump.Before(s)) * bump.Density(s) * ColorAt(s);
    };
    sum += half * weights[0] * value(0);
    for (int k = 1; k < 3; ++k) sum += half * weights[k] * (value(nodes[k]) + value(-nodes[k]));
  }
  return sum;
}

// [R, S] of R equal rays: density and colour in the middles of equal intervals, and their lengths.
struct Steps {
  torch::Tensor density, delta, color;
};

Steps StepsOf(const Bump& bump, int64_t steps, int64_t rays, at::ScalarType type) {
  auto density = torch::empty({1, steps}, torch::kFloat64), color = torch::empty_like(density);
  for (int64_t i = 0; i < steps; ++i) {
    const Real s = (static_cast<Real>(i) + static_cast<Real>(0.5)) / static_cast<Real>(steps);
    density[0][i] = static_cast<double>(bump.Density(s));
    color[0][i] = static_cast<double>(ColorAt(s));
  }
  const auto rows = [&](const torch::Tensor& row) { return row.to(type).expand({rays, steps}).contiguous(); };
  return {rows(density), rows(torch::full_like(density, 1.0 / static_cast<double>(steps))), rows(color)};
}

torch::Tensor OurColor(const Steps& s) {
  return (ComputeRayWeights(s.density, s.delta, false).weights * s.color).sum(1);
}

torch::Tensor PackedColor(const Steps& s) {
  const auto offsets = torch::arange(s.density.size(0) + 1, torch::kInt64) * s.density.size(1);
  const auto weights = CompositePacked(s.density.flatten(), s.delta.flatten(), offsets).weights;
  return (weights.view(s.color.sizes()) * s.color).sum(1);
}

// As the fused pass has it: thickness is summed in double, and light and weights are found in float32, all rays at
// once.
torch::Tensor FusedColor(const Steps& s) {
  const auto tau = s.density * s.delta;
  auto before = torch::empty_like(tau), light = torch::empty_like(tau), weights = torch::empty_like(tau);
  const int64_t count = tau.size(1);
  for (int64_t r = 0; r < tau.size(0); ++r) {
    const float* const own = tau.data_ptr<float>() + r * count;
    float* const to = before.data_ptr<float>() + r * count;
    double thickness = 0;
    for (int64_t i = 0; i < count; ++i) {
      to[i] = static_cast<float>(thickness);
      thickness += own[i];
    }
  }
  LightAlongRays(tau.data_ptr<float>(), before.data_ptr<float>(), tau.numel(), light.data_ptr<float>(),
                 weights.data_ptr<float>());
  return (weights * s.color).sum(1);
}

// The habit of NeRF's published programs: alpha from exp, transmittance as a running product that must not be 0.
torch::Tensor ProductColor(const Steps& s) {
  const auto alpha = 1 - torch::exp(-s.density * s.delta);
  const auto passing = torch::cumprod(1 - alpha + 1e-10, 1);
  const auto before =
      torch::cat({torch::ones_like(passing.narrow(1, 0, 1)), passing.narrow(1, 0, s.density.size(1) - 1)}, 1);
  return (before * alpha * s.color).sum(1);
}

// Euler's explicit steps, T_{i+1} = T_i (1 - tau_i): unstable where tau_i > 2.
torch::Tensor EulerColor(const Steps& s) {
  const auto tau = s.density * s.delta;
  const auto passing = torch::cumprod(1 - tau, 1);
  const auto before =
      torch::cat({torch::ones_like(passing.narrow(1, 0, 1)), passing.narrow(1, 0, s.density.size(1) - 1)}, 1);
  return (before * tau * s.color).sum(1);
}

}  // namespace

std::vector<IntegrationPoint> IntegrationErrors(int64_t repeats, double least_seconds) {
  struct Way {
    const char* name;
    torch::Tensor (*color)(const Steps&);
    at::ScalarType type;
  };
  const std::vector<Way> ways = {{"exp of a sum, float64", OurColor, torch::kFloat64},
                                 {"exp of a sum, float32", OurColor, torch::kFloat32},
                                 {"packed kernel, float32", PackedColor, torch::kFloat32},
                                 {"fused kernel, float32", FusedColor, torch::kFloat32},
                                 {"cumprod(1 - alpha), float32", ProductColor, torch::kFloat32},
                                 {"explicit Euler, float32", EulerColor, torch::kFloat32}};
  const torch::NoGradGuard no_grad;
  const OneThread one_thread;
  std::vector<IntegrationPoint> points;
  for (const double thickness : {1e-6, 1.0, 1e6}) {
    const Bump bump = {static_cast<Real>(thickness)};
    const auto exact = static_cast<double>(ExactColor(bump));
    for (const int64_t steps : {16, 64, 256, 1024, 4096}) {
      for (const Way& way : ways) {
        const Steps s = StepsOf(bump, steps, kSamplesAtOnce / steps, way.type);
        const double found = way.color(s)[0].item<double>();
        const std::function<void()> body = [&] { way.color(s); };
        const PairTiming timing = TimePair(body, body, repeats, least_seconds);
        points.push_back({way.name, thickness, steps, std::abs(found - exact) / exact,
                          1e9 * timing.body.processor / static_cast<double>(kSamplesAtOnce)});
      }
    }
  }
  return points;
}

}  // namespace editnerf
