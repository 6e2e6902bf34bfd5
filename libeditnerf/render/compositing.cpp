#include "libeditnerf/render/compositing.h"

#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

// [R, S] -> sums over all earlier samples.
torch::Tensor ExclusiveSum(const torch::Tensor& values) {
  const int64_t count = values.size(1);
  return torch::cat({torch::zeros_like(values.narrow(1, 0, 1)), values.narrow(1, 0, count - 1).cumsum(1)}, 1);
}

// 1 - exp(-tau), by expm1 for the sake of thin intervals. LibTorch differentiates that as expm1(-tau) + 1, of which
// nothing is left in opaque ones: in float32 the gradient is off by a thousandth at tau = 10, and lost at 17.
class OpacityFunction : public torch::autograd::Function<OpacityFunction> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& tau) {
    context->save_for_backward({tau});
    return -torch::expm1(-tau);
  }
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list grads) {
    return {grads[0] * torch::exp(-context->get_saved_variables()[0])};
  }
};

torch::Tensor OpacityOf(const torch::Tensor& tau) { return OpacityFunction::apply(tau); }

void CheckSamples(const torch::Tensor& a, const torch::Tensor& b, const char* name_a, const char* name_b) {
  CheckShape(a, {kAny, kAny}, name_a);
  CheckShape(b, {a.size(0), a.size(1)}, name_b);
  if (a.size(1) == 0) Throw<ShapeError>("{}: a ray needs at least one sample, found {}", name_a, ShapeString(a));
}

}  // namespace

RayWeights ComputeRayWeights(const torch::Tensor& density, const torch::Tensor& delta, bool opaque_end) {
  CheckSamples(density, delta, "density", "delta");
  const int64_t count = density.size(1);
  RayWeights ray;
  if (!opaque_end) {
    const auto tau = density * delta;
    const auto total = tau.sum(1);
    ray.weights = torch::exp(-ExclusiveSum(tau)) * OpacityOf(tau);
    ray.transparency = torch::exp(-total);
    ray.opacity = OpacityOf(total);
    return ray;
  }
  const auto tau = density.narrow(1, 0, count - 1) * delta.narrow(1, 0, count - 1);
  const auto total = tau.sum(1);
  const auto last = torch::exp(-total).unsqueeze(1);
  ray.weights = count == 1 ? last : torch::cat({torch::exp(-ExclusiveSum(tau)) * OpacityOf(tau), last}, 1);
  ray.transparency = torch::zeros_like(total);
  ray.opacity = OpacityOf(total);
  return ray;
}

torch::Tensor CompositeColor(const RayWeights& ray, const torch::Tensor& radiance, const torch::Tensor& background) {
  CheckShape(radiance, {ray.weights.size(0), ray.weights.size(1), 3}, "radiance");
  auto color = (ray.weights.unsqueeze(2) * radiance).sum(1);
  if (background.defined()) {
    CheckLastDim(background, 3, "background");
    color = color + ray.transparency.unsqueeze(1) * background;
  }
  return color;
}

torch::Tensor ExpectedDepth(const torch::Tensor& weights, const torch::Tensor& t) {
  CheckSamples(weights, t, "weights", "t");
  const auto sum = weights.sum(1);
  const auto enough = sum > 1e-12;
  // The divisor is chosen before the division, so that no gradient passes through a division by zero.
  const auto mean = (weights * t).sum(1) / torch::where(enough, sum, torch::ones_like(sum));
  return torch::where(enough, mean, torch::zeros_like(mean));
}

SurfaceSample FindSurface(const torch::Tensor& weights, const torch::Tensor& t, bool opaque_end) {
  CheckSamples(weights, t, "weights", "t");
  torch::NoGradGuard no_grad;
  const int64_t last = weights.size(1) - 1;
  SurfaceSample surface;
  const auto reached = (weights.detach().cumsum(1) < 0.5).sum(1);  // samples before the surface
  surface.valid = opaque_end ? reached < last : reached <= last;
  surface.index = reached.clamp_max(last);
  const auto depth = t.detach().gather(1, surface.index.unsqueeze(1)).squeeze(1);
  surface.depth = torch::where(surface.valid, depth, torch::full_like(depth, std::numeric_limits<double>::quiet_NaN()));
  return surface;
}

torch::Tensor DistortionLoss(const torch::Tensor& weights, const torch::Tensor& s, const torch::Tensor& d) {
  CheckSamples(weights, s, "weights", "s");
  CheckSamples(weights, d, "weights", "d");
  const auto weight_before = ExclusiveSum(weights);
  const auto moment_before = ExclusiveSum(weights * s);
  const auto between = 2 * (weights * (s * weight_before - moment_before)).sum(1);
  return between + (weights.square() * d).sum(1) / 3;
}

}  // namespace editnerf
