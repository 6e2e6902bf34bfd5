#include "libeditnerf/render/ray_marcher.h"

#include <torch/torch.h>

#include "libeditnerf/render/compositing.h"
#include "tests/catch.h"
#include "tests/central_differences.h"

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
  const auto loss = [&](const torch::Tensor& x) {
    return ComputeRayWeights(padding.Pad(x), padding.Pad(m.samples.delta), false).weights.square().sum();
  };
  CHECK(GradientError(loss, packed_density) < 1e-8);
}

TEST_CASE("marching through nothing keeps one sample so that gradients have a path") {
  const auto m = March(4, 10, 0.0);
  CHECK(m.samples.t.size(0) == 1);
  CHECK(m.samples.ray[0].item<int64_t>() == 0);
  CHECK(RayPadding(m.samples).width() == 1);
  const auto some = March(4, 10, 0.5).samples;
  const auto none = SelectSamples(some, torch::zeros({some.t.size(0)}, torch::kBool));
  CHECK(none.t.size(0) == 1);
}

TEST_CASE("only samples behind the early stop are dropped, and the colour moves by no more than it") {
  torch::manual_seed(3);
  const auto m = March(50, 64, 0.6);
  const auto density = torch::rand({m.samples.t.size(0)}, torch::kFloat64) * 40;
  const auto radiance = torch::rand({m.samples.t.size(0), 3}, torch::kFloat64);
  const auto render = [](const PackedSamples& samples, const torch::Tensor& sigma, const torch::Tensor& color) {
    const RayPadding padding(samples);
    return CompositeColor(ComputeRayWeights(padding.Pad(sigma), padding.Pad(samples.delta), false), padding.Pad(color));
  };
  for (const double stop : {1e-3, 0.1}) {
    const auto reached = ReachedSamples(m.samples, density, stop);
    const auto kept = SelectSamples(m.samples, reached);
    const auto full = render(m.samples, density, radiance);
    const auto stopped = render(kept, density.index({reached}), radiance.index({reached}));
    CHECK((full - stopped).abs().max().item<double>() <= stop);
    // What is dropped lies behind what is kept: along each ray `reached` never rises again.
    const RayPadding padding(m.samples);
    CHECK((padding.Pad(reached.to(torch::kFloat32)).diff(1, 1) <= 0).all().item<bool>());
  }
  CHECK(ReachedSamples(m.samples, density, 0.1).sum().item<int64_t>() < m.samples.t.size(0));
  CHECK(ReachedSamples(m.samples, torch::zeros_like(density), 0.1).all().item<bool>());
}

TEST_CASE("marching in waves keeps what one pass over all samples keeps") {
  torch::manual_seed(4);
  const auto t = torch::arange(40, torch::kFloat64).expand({6, 40}).contiguous();
  const auto samples = PackSamples(t, torch::ones_like(t), torch::rand({6, 40}) < 0.7);
  const auto density = torch::rand({40}, torch::kFloat64) * torch::linspace(0, 3, 40, torch::kFloat64);
  const auto at = [&](const PackedSamples& some) { return density.index_select(0, some.t.to(torch::kInt64)); };
  int64_t asked = 0;
  const auto waves = MarchUntilOpaque(samples, 1e-2, [&](const PackedSamples& some) {
    asked += some.t.size(0);
    return at(some);
  });
  const auto once = SelectSamples(samples, ReachedSamples(samples, at(samples), 1e-2));
  CHECK(torch::equal(waves.t, once.t));
  CHECK(torch::equal(waves.ray, once.ray));
  CHECK(asked < samples.t.size(0));
}
