#include "libeditnerf/render/sampling.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

// [R, count]: (k + u) / count with u random in [0, 1) or 0.5.
torch::Tensor Quantiles(int64_t rays, int64_t count, bool jitter, const torch::TensorOptions& options) {
  const auto k = torch::arange(count, options).unsqueeze(0);
  if (jitter) return (k + torch::rand({rays, count}, options)) / count;
  return ((k + 0.5) / count).expand({rays, count});
}

}  // namespace

torch::Tensor StratifiedSamples(const torch::Tensor& near, const torch::Tensor& far, int64_t count, bool jitter) {
  CheckShape(near, {kAny}, "near");
  CheckShape(far, {near.size(0)}, "far");
  torch::NoGradGuard no_grad;
  const auto quantiles = Quantiles(near.size(0), count, jitter, near.options().requires_grad(false));
  return near.unsqueeze(1) + (far - near).unsqueeze(1) * quantiles;
}

torch::Tensor SampleFromBins(const torch::Tensor& edges, const torch::Tensor& weights, int64_t count, bool jitter) {
  CheckShape(weights, {kAny, kAny}, "weights");
  CheckShape(edges, {weights.size(0), weights.size(1) + 1}, "edges");
  torch::NoGradGuard no_grad;
  const auto floored = weights.detach().clamp_min(0) + 1e-5;
  const auto share = floored / floored.sum(1, true);
  const auto inner = share.cumsum(1).clamp_max(1);
  const auto distribution = torch::cat({torch::zeros_like(inner.narrow(1, 0, 1)), inner}, 1);  // [R, B + 1]
  const auto u = Quantiles(weights.size(0), count, jitter, share.options()).contiguous();
  const auto upper =
      torch::searchsorted(distribution, u, /*out_int32=*/false, /*right=*/true).clamp(1, weights.size(1));
  const auto lower = upper - 1;
  const auto u0 = distribution.gather(1, lower), u1 = distribution.gather(1, upper);
  const auto e0 = edges.gather(1, lower), e1 = edges.gather(1, upper);
  const auto span = u1 - u0;
  const auto part = ((u - u0) / torch::where(span > 0, span, torch::ones_like(span))).clamp(0, 1);
  return e0 + part * (e1 - e0);
}

torch::Tensor HierarchicalSamples(const torch::Tensor& t, const torch::Tensor& weights, int64_t count, bool jitter) {
  CheckShape(t, {kAny, kAny}, "t");
  CheckShape(weights, {t.size(0), t.size(1)}, "weights");
  const int64_t samples = t.size(1);
  if (samples < 3) Throw<ShapeError>("t: expected at least 3 samples a ray, found {}", ShapeString(t));
  torch::NoGradGuard no_grad;
  const auto edges = (t.narrow(1, 0, samples - 1) + t.narrow(1, 1, samples - 1)) / 2;
  const auto more = SampleFromBins(edges, weights.narrow(1, 1, samples - 2), count, jitter);
  return std::get<0>(torch::cat({t, more}, 1).sort(1));
}

torch::Tensor IntervalLengths(const torch::Tensor& t, const torch::Tensor& far) {
  CheckShape(t, {kAny, kAny}, "t");
  CheckShape(far, {t.size(0)}, "far");
  torch::NoGradGuard no_grad;
  const auto ends = torch::cat({t.narrow(1, 1, t.size(1) - 1), far.unsqueeze(1)}, 1);
  return (ends - t).clamp_min(0);
}

}  // namespace editnerf
