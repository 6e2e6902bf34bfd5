#include "libeditnerf/render/ray_marcher.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "libeditnerf/kernels/packed_compositing.h"
#include "libeditnerf/render/compositing.h"

namespace editnerf {
namespace {

std::vector<int64_t> WithSizes(std::vector<int64_t> sizes, const torch::Tensor& values, int64_t first_dim) {
  for (int64_t dim = first_dim; dim < values.dim(); ++dim) sizes.push_back(values.size(dim));
  return sizes;
}

// Of each ray's samples `count` [R] from number `first` [R] on.
PackedSamples Section(const PackedSamples& samples, const std::vector<int64_t>& first,
                      const std::vector<int64_t>& count) {
  PackedSamples section;
  const auto offsets = torch::zeros({static_cast<int64_t>(count.size()) + 1}, torch::kInt64);
  int64_t* const offset = offsets.data_ptr<int64_t>();
  std::partial_sum(count.begin(), count.end(), offset + 1);
  const auto index = torch::empty({offset[count.size()]}, torch::kInt64);
  for (size_t ray = 0; ray < count.size(); ++ray) {
    int64_t* const own = index.data_ptr<int64_t>() + offset[ray];
    std::iota(own, own + count[ray], first[ray]);
  }
  section.offsets = offsets.to(samples.offsets.device());
  const auto at = index.to(samples.ray.device());
  section.ray = samples.ray.index_select(0, at);
  section.t = samples.t.index_select(0, at);
  section.delta = samples.delta.index_select(0, at);
  return section;
}

torch::Tensor ToDoubles(const torch::Tensor& values) { return values.to(torch::kCPU, torch::kFloat64).contiguous(); }

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
  auto kept = keep.flatten().nonzero().squeeze(1);
  if (kept.size(0) == 0) kept = kept.new_zeros({1});
  PackedSamples samples;
  samples.ray = torch::div(kept, t.size(1), "floor");
  samples.t = t.reshape({-1}).index_select(0, kept);
  samples.delta = delta.reshape({-1}).index_select(0, kept);
  const auto counts = torch::bincount(samples.ray, {}, t.size(0));
  samples.offsets = torch::cat({counts.new_zeros({1}), counts.cumsum(0)});
  return samples;
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

PackedSamples SamplesFrom(const PackedSamples& samples, const torch::Tensor& start) {
  const torch::NoGradGuard no_grad;
  const int64_t rays = samples.offsets.size(0) - 1;
  CheckShape(start, {rays}, "start");
  torch::Tensor kept = (samples.t >= start.index_select(0, samples.ray)).nonzero().squeeze(1);
  if (kept.size(0) == 0) kept = torch::zeros({1}, kept.options());
  PackedSamples rest;
  rest.ray = samples.ray.index_select(0, kept);
  rest.t = samples.t.index_select(0, kept);
  rest.delta = samples.delta.index_select(0, kept);
  rest.offsets = torch::zeros_like(samples.offsets);
  rest.offsets.slice(0, 1).copy_(rest.ray.bincount({}, rays).cumsum(0));
  return rest;
}

PackedSamples MarchUntilOpaque(const PackedSamples& samples, double early_stop,
                               const std::function<torch::Tensor(const PackedSamples&)>& density) {
  constexpr int64_t kWave = 8;  // samples per ray
  torch::NoGradGuard no_grad;
  const auto offsets = samples.offsets.to(torch::kCPU).contiguous();
  const auto rays = static_cast<size_t>(offsets.size(0) - 1);
  const int64_t* const offset = offsets.data_ptr<int64_t>();
  const std::vector<int64_t> begin(offset, offset + rays);
  std::vector<int64_t> next = begin, asked(rays), reached(rays);
  std::vector<double> passed(rays);  // optical thickness
  const double opaque = -std::log(early_stop);
  for (;;) {
    for (size_t ray = 0; ray < rays; ++ray) {
      asked[ray] = passed[ray] <= opaque ? std::min(kWave, offset[ray + 1] - next[ray]) : 0;
    }
    const PackedSamples wave = Section(samples, next, asked);
    if (wave.t.size(0) == 0) break;
    const auto found = ToDoubles(density(wave)), deltas = ToDoubles(wave.delta);
    CheckShape(found, {wave.t.size(0)}, "density");
    const double *sigma = found.data_ptr<double>(), *delta = deltas.data_ptr<double>();
    for (size_t ray = 0; ray < rays; ++ray) {
      for (int64_t i = 0; i < asked[ray]; ++i) {
        if (passed[ray] <= opaque) ++reached[ray];
        passed[ray] += *sigma++ * *delta++;
      }
      next[ray] += asked[ray];
    }
  }
  return Section(samples, begin, reached);
}

MarchedPicture CompositeSamples(const PackedSamples& samples, const torch::Tensor& density,
                                const torch::Tensor& radiance, const torch::Tensor& background, bool with_distortion) {
  const auto type = density.scalar_type();
  const bool packed = density.is_cpu() && !PlainOperations::Wanted() &&
                      (type == torch::kFloat32 || type == torch::kFloat64) && samples.delta.scalar_type() == type &&
                      (!radiance.defined() || radiance.scalar_type() == type);
  if (!packed) return CompositePadded(samples, density, radiance, background, with_distortion);
  const auto seen = CompositePacked(density, samples.delta, samples.offsets, radiance,
                                    background.defined() ? background.to(density.options()) : background);
  const auto surface = FindPackedSurface(seen.weights, samples.t, samples.offsets);
  MarchedPicture picture;
  picture.rgb = seen.rgb;
  picture.opacity = seen.opacity;
  picture.weights = seen.weights;
  picture.surface_sample = surface.sample;
  picture.depth = surface.depth;
  picture.depth_valid = surface.valid;
  if (with_distortion) {
    picture.distortion = PackedDistortion(seen.weights, samples.t, samples.delta, samples.offsets);
  }
  return picture;
}

MarchedPicture CompositePadded(const PackedSamples& samples, const torch::Tensor& density,
                               const torch::Tensor& radiance, const torch::Tensor& background, bool with_distortion) {
  const RayPadding padding(samples);
  const auto t = padding.Pad(samples.t), delta = padding.Pad(samples.delta);
  const auto seen = ComputeRayWeights(padding.Pad(density), delta, /*opaque_end=*/false);
  const auto surface = FindSurface(seen.weights, t, /*opaque_end=*/false);
  MarchedPicture picture;
  if (radiance.defined()) picture.rgb = CompositeColor(seen, padding.Pad(radiance), background);
  picture.opacity = seen.opacity;
  picture.weights = padding.Unpad(seen.weights);
  picture.surface_sample =
      (samples.offsets.narrow(0, 0, surface.index.size(0)) + surface.index).clamp_max(samples.t.size(0) - 1);
  picture.depth = surface.depth;
  picture.depth_valid = surface.valid;
  if (with_distortion) picture.distortion = DistortionLoss(seen.weights, t, delta);
  return picture;
}

}  // namespace editnerf
