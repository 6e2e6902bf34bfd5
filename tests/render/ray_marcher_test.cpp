#include "libeditnerf/render/ray_marcher.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/render/compositing.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

struct Marched {
  torch::Tensor t, delta, keep;
  PackedSamples samples;
};

Marched March(int64_t rays, int64_t steps, double share) {
  Marched m;
  const auto near = torch::full({rays}, 0.5, torch::kFloat64), far = torch::rand({rays}, torch::kFloat64) + 1;
  m.t = MarchCandidates(near, far, steps, torch::rand_like(near));
  m.delta = ((far - near) / steps).unsqueeze(1).expand({rays, steps});
  m.keep = torch::rand({rays, steps}) < share;
  m.samples = PackSamples(m.t, m.delta, m.keep);
  return m;
}

// Light [S] that reaches each sample.
torch::Tensor LightAt(const PackedSamples& samples, const torch::Tensor& density) {
  const RayPadding padding(samples);
  const auto tau = padding.Pad(density * samples.delta);
  return padding.Unpad(torch::exp(tau - tau.cumsum(1)));
}

}  // namespace

TEST_CASE("march candidates are equally spaced, one in each interval") {
  const auto near = torch::ones({3}, torch::kFloat64), far = torch::full({3}, 3.0, torch::kFloat64);
  const auto t = MarchCandidates(near, far, 4, torch::full_like(near, 0.5));
  CHECK(torch::allclose(t[0], torch::tensor({1.25, 1.75, 2.25, 2.75}, torch::kFloat64)));
  const auto jittered = MarchCandidates(near, far, 4, torch::rand_like(near));
  CHECK(torch::allclose(jittered.diff(1, 1), torch::full({3, 3}, 0.5, torch::kFloat64)));
  CHECK(((jittered >= 1) & (jittered < 3)).all().item<bool>());
}

TEST_CASE("packed samples are in ray order and unpack to themselves") {
  torch::manual_seed(1);
  auto m = March(7, 20, 0.4);
  m.keep[3].fill_(false);
  const auto samples = PackSamples(m.t, m.delta, m.keep);
  CHECK(samples.t.size(0) == m.keep.sum().item<int64_t>());
  CHECK((samples.ray.diff() >= 0).all().item<bool>());
  CHECK(samples.offsets.size(0) == 8);
  CHECK(samples.offsets[7].item<int64_t>() == samples.t.size(0));
  CHECK(samples.offsets[3].item<int64_t>() == samples.offsets[4].item<int64_t>());
  const RayPadding padding(samples);
  CHECK(padding.width() == m.keep.sum(1).max().item<int64_t>());
  CHECK(torch::equal(padding.Unpad(padding.Pad(samples.t)), samples.t));
  const auto wide = torch::rand({samples.t.size(0), 3});
  CHECK(torch::equal(padding.Unpad(padding.Pad(wide)), wide));
}

TEST_CASE("packed compositing equals dense compositing with zero density where nothing is kept") {
  torch::manual_seed(2);
  const auto m = March(9, 30, 0.3);
  const auto density = torch::rand({9, 30}, torch::kFloat64) * 10 * m.keep;
  const auto radiance = torch::rand({9, 30, 3}, torch::kFloat64);
  const auto dense = ComputeRayWeights(density, m.delta, false);
  const RayPadding padding(m.samples);
  const auto packed_density = density.index({m.keep}), packed_radiance = radiance.index({m.keep});
  const auto packed = ComputeRayWeights(padding.Pad(packed_density), padding.Pad(m.samples.delta), false);
  CHECK(torch::allclose(CompositeColor(packed, padding.Pad(packed_radiance)), CompositeColor(dense, radiance), 1e-13,
                        1e-14));
  CHECK(torch::allclose(packed.opacity, dense.opacity, 1e-13, 1e-14));
  const auto near_half = FindSurface(packed.weights, padding.Pad(m.samples.t), false);
  const auto expected = FindSurface(dense.weights, m.t, false);
  CHECK(torch::equal(near_half.valid, expected.valid));
  CHECK(torch::equal(near_half.depth.nan_to_num(-1), expected.depth.nan_to_num(-1)));
  const auto leaf = Leaf(packed_density);
  const auto weights = [&] {
    return ComputeRayWeights(padding.Pad(leaf), padding.Pad(m.samples.delta), false).weights;
  };
  CHECK(GradientError(weights, {leaf}) < 1e-7);
}

TEST_CASE("samples from a distance on are those of each ray behind it, or the first where none is") {
  torch::manual_seed(3);
  const auto m = March(9, 30, 0.4);
  const auto start = torch::rand({9}, torch::kFloat64) * 2;
  const auto rest = SamplesFrom(m.samples, start);
  const auto expected = PackSamples(m.t, m.delta, m.keep & (m.t >= start.unsqueeze(1)));
  CHECK(rest.t.size(0) < m.samples.t.size(0));
  CHECK(torch::equal(rest.t, expected.t));
  CHECK(torch::equal(rest.ray, expected.ray));
  CHECK(torch::equal(rest.delta, expected.delta));
  CHECK(torch::equal(rest.offsets, expected.offsets));
  const auto none = SamplesFrom(m.samples, torch::full({9}, 100.0, torch::kFloat64));
  CHECK(none.t.size(0) == 1);
  CHECK(none.offsets[9].item<int64_t>() == 1);
}

TEST_CASE("marching through nothing keeps one sample so that gradients have a path") {
  const auto m = March(4, 10, 0.0);
  CHECK(m.samples.t.size(0) == 1);
  CHECK(m.samples.ray[0].item<int64_t>() == 0);
  CHECK(RayPadding(m.samples).width() == 1);
}

TEST_CASE("what packed samples show is what padded ones show") {
  torch::manual_seed(6);
  const auto m = March(30, 20, 0.4);
  const int64_t count = m.samples.t.size(0);
  const auto density = torch::rand({count}, torch::kFloat64) * 30, radiance = torch::rand({count, 3}, torch::kFloat64);
  const auto background = torch::rand({3}, torch::kFloat64);
  const auto packed = CompositeSamples(m.samples, density, radiance, background, /*with_distortion=*/true);
  const auto padded = CompositePadded(m.samples, density, radiance, background, /*with_distortion=*/true);
  CHECK(torch::allclose(packed.rgb, padded.rgb, 1e-12, 1e-14));
  CHECK(torch::allclose(packed.opacity, padded.opacity, 1e-12, 1e-14));
  CHECK(torch::allclose(packed.distortion, padded.distortion, 1e-11, 1e-14));
  CHECK(torch::equal(packed.depth_valid, padded.depth_valid));
  CHECK(torch::equal(packed.depth.nan_to_num(-1), padded.depth.nan_to_num(-1)));
  CHECK(torch::equal(packed.surface_sample.index({packed.depth_valid}),
                     padded.surface_sample.index({packed.depth_valid})));
  const auto without = CompositeSamples(m.samples, density, {}, {}, /*with_distortion=*/false);
  CHECK_FALSE(without.rgb.defined());
  CHECK_FALSE(without.distortion.defined());
  // Types that differ take the padded way.
  CHECK(CompositeSamples(m.samples, density.to(torch::kFloat32), radiance, background, true).rgb.dtype() ==
        torch::kFloat64);
}

TEST_CASE("only samples behind the early stop are dropped, and most of them are not evaluated") {
  torch::manual_seed(3);
  const auto t = torch::arange(64, torch::kFloat64).expand({50, 64}).contiguous();
  const auto samples = PackSamples(t, torch::full_like(t, 0.02), torch::rand({50, 64}) < 0.6);
  const auto table = torch::rand({64}, torch::kFloat64) * 40;
  const auto density = [&](const PackedSamples& some) { return table.index_select(0, some.t.to(torch::kInt64)); };
  for (const double stop : {1e-3, 0.1, 1.0}) {
    int64_t asked = 0;
    const auto reached = MarchUntilOpaque(samples, stop, [&](const PackedSamples& some) {
      asked += some.t.size(0);
      return density(some);
    });
    const auto expected = LightAt(samples, density(samples)) >= stop;
    CHECK(torch::equal(reached.t, samples.t.index({expected})));
    CHECK(torch::equal(reached.ray, samples.ray.index({expected})));
    CHECK(torch::equal(reached.delta, samples.delta.index({expected})));
    CHECK(torch::equal(reached.offsets.diff(), torch::bincount(reached.ray, {}, 50)));
    CHECK(asked < samples.t.size(0));
    CHECK(asked <= reached.t.size(0) + 50 * 8);
    const auto radiance = torch::rand({64, 3}, torch::kFloat64);
    const auto rgb = [&](const PackedSamples& some) {
      return CompositeSamples(some, density(some), radiance.index_select(0, some.t.to(torch::kInt64)), {}, false).rgb;
    };
    CHECK((rgb(samples) - rgb(reached)).abs().max().item<double>() <= stop);
  }
  const auto all = MarchUntilOpaque(samples, 0.1, [](const PackedSamples& some) { return torch::zeros_like(some.t); });
  CHECK(torch::equal(all.t, samples.t));
}
