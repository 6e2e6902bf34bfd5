#include "libeditnerf/render/ray_marcher.h"

#include <cmath>

#include <torch/torch.h>

#include <algorithm>
#include <vector>

#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

torch::Tensor OffsetsOf(const torch::Tensor& ray, int64_t rays) {
  const auto counts = torch::bincount(ray, {}, rays);
  return torch::cat({counts.new_zeros({1}), counts.cumsum(0)});
}

std::vector<int64_t> WithSizes(std::vector<int64_t> sizes, const torch::Tensor& values, int64_t first_dim) {
  for (int64_t dim = first_dim; dim < values.dim(); ++dim) sizes.push_back(values.size(dim));
  return sizes;
}

// Indices of the kept entries, never empty.
torch::Tensor KeptIndices(const torch::Tensor& keep) {
  const auto indices = keep.flatten().nonzero().squeeze(1);
  return indices.size(0) > 0 ? indices : indices.new_zeros({1});
}

}  // namespace

torch::Tensor MarchCandidates(const torch::Tensor& near, const torch::Tensor& far, int64_t steps,
                              const torch::Tensor& within) {
  CheckShape(near, {kAny}, "near");
  CheckShape(far, {near.size(0)}, "far");
  CheckShape(within, {near.size(0)}, "within");
  torch::NoGradGuard no_grad;
  const auto options = near.options().requires_grad(false);
  return near.unsqueeze(1) + (torch::arange(steps, options) + within.unsqueeze(1)) *
                                 ((far - near) / static_cast<double>(steps)).unsqueeze(1);
}

PackedSamples PackSamples(const torch::Tensor& t, const torch::Tensor& delta, const torch::Tensor& keep) {
  CheckShape(t, {kAny, kAny}, "t");
  CheckShape(delta, {t.size(0), t.size(1)}, "delta");
  CheckShape(keep, {t.size(0), t.size(1)}, "keep");
  torch::NoGradGuard no_grad;
  const auto kept = KeptIndices(keep);
  PackedSamples samples;
  samples.ray = torch::div(kept, t.size(1), "floor");
  samples.t = t.reshape({-1}).index_select(0, kept);
  samples.delta = delta.reshape({-1}).index_select(0, kept);
  samples.offsets = OffsetsOf(samples.ray, t.size(0));
  return samples;
}

PackedSamples SelectSamples(const PackedSamples& samples, const torch::Tensor& keep) {
  CheckShape(keep, {samples.t.size(0)}, "keep");
  torch::NoGradGuard no_grad;
  const auto kept = KeptIndices(keep);
  PackedSamples selected;
  selected.ray = samples.ray.index_select(0, kept);
  selected.t = samples.t.index_select(0, kept);
  selected.delta = samples.delta.index_select(0, kept);
  selected.offsets = OffsetsOf(selected.ray, samples.offsets.size(0) - 1);
  return selected;
}

RayPadding::RayPadding(const PackedSamples& samples) : rays_(samples.offsets.size(0) - 1) {
  torch::NoGradGuard no_grad;
  const auto counts = samples.offsets.diff();
  width_ = std::max<int64_t>(rays_ > 0 ? counts.max().item<int64_t>() : 0, 1);
  const auto rank =
      torch::arange(samples.ray.size(0), samples.ray.options()) - samples.offsets.index_select(0, samples.ray);
  position_ = samples.ray * width_ + rank;
}

torch::Tensor RayPadding::Pad(const torch::Tensor& values) const {
  auto flat = torch::zeros(WithSizes({rays_ * width_}, values, 1), values.options().requires_grad(false));
  flat.index_put_({position_}, values);
  return flat.view(WithSizes({rays_, width_}, values, 1));
}

torch::Tensor RayPadding::Unpad(const torch::Tensor& padded) const {
  return padded.reshape(WithSizes({rays_ * width_}, padded, 2)).index_select(0, position_);
}

torch::Tensor ReachedSamples(const PackedSamples& samples, const torch::Tensor& density, double early_stop) {
  CheckShape(density, {samples.t.size(0)}, "density");
  torch::NoGradGuard no_grad;
  const RayPadding padding(samples);
  const auto tau = padding.Pad(density.detach() * samples.delta);
  const auto before =
      torch::cat({torch::zeros_like(tau.narrow(1, 0, 1)), tau.cumsum(1).narrow(1, 0, tau.size(1) - 1)}, 1);
  return padding.Unpad(torch::exp(-before)) >= early_stop;
}

PackedSamples MarchUntilOpaque(const PackedSamples& samples, double early_stop,
                               const std::function<torch::Tensor(const PackedSamples&)>& density) {
  constexpr int64_t kWave = 8;  // samples per ray
  torch::NoGradGuard no_grad;
  const int64_t count = samples.t.size(0);
  const auto rank = torch::arange(count, samples.ray.options()) - samples.offsets.index_select(0, samples.ray);
  const auto wave = rank.div(kWave, "floor");
  const int64_t waves = count > 0 ? wave.max().item<int64_t>() + 1 : 0;
  const double opaque = -std::log(early_stop);
  auto values = torch::zeros_like(samples.t);
  auto evaluated = torch::zeros_like(samples.ray, torch::kBool);
  auto passed = torch::zeros({samples.offsets.size(0) - 1}, samples.t.options());  // optical thickness of each ray
  for (int64_t w = 0; w < waves; ++w) {
    const auto wanted = wave.eq(w).logical_and(passed.index_select(0, samples.ray) <= opaque);
    const auto index = wanted.nonzero().squeeze(1);
    if (index.size(0) == 0) continue;
    const auto found = density(SelectSamples(samples, wanted)).to(values.dtype());
    values.index_copy_(0, index, found);
    evaluated = evaluated.logical_or(wanted);
    passed.index_add_(0, samples.ray.index_select(0, index), found * samples.delta.index_select(0, index));
  }
  return SelectSamples(samples, evaluated.logical_and(ReachedSamples(samples, values, early_stop)));
}

}  // namespace editnerf
