#include "libeditnerf/render/sampling.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("stratified samples lie one in each part") {
  torch::manual_seed(1);
  const auto near = torch::tensor({1.0, 2.0}, torch::kFloat64), far = torch::tensor({2.0, 6.0}, torch::kFloat64);
  for (const bool jitter : {false, true}) {
    const auto t = StratifiedSamples(near, far, 8, jitter);
    const auto part = torch::floor((t - near.unsqueeze(1)) / (far - near).unsqueeze(1) * 8);
    CHECK(torch::equal(part, torch::arange(8, torch::kFloat64).expand({2, 8})));
  }
  const auto middle = StratifiedSamples(near, far, 4, false);
  CHECK(torch::allclose(middle[1], torch::tensor({2.5, 3.5, 4.5, 5.5}, torch::kFloat64)));
}

TEST_CASE("samples drawn from bins follow the weights") {
  torch::manual_seed(2);
  const auto edges = torch::tensor({{0.0, 1.0, 1.5, 4.0, 5.0}}, torch::kFloat64);
  const auto weights = torch::tensor({{1.0, 3.0, 0.0, 4.0}}, torch::kFloat64);
  for (const bool jitter : {false, true}) {
    const auto t = SampleFromBins(edges, weights, 8000, jitter);
    const auto share = torch::histc(t, 40, 0, 5) / 8000.0;  // bins of 1/8
    CHECK(share.slice(0, 0, 8).sum().item<double>() == Approx(0.125).margin(1e-3));
    CHECK(share.slice(0, 8, 12).sum().item<double>() == Approx(0.375).margin(1e-3));
    CHECK(share.slice(0, 12, 32).sum().item<double>() < 1e-3);
    CHECK(share.slice(0, 32, 40).max().item<double>() == Approx(0.5 / 8).margin(1e-3));
  }
}

TEST_CASE("bins without any weight are sampled evenly and stay finite") {
  const auto edges = torch::linspace(0, 1, 9).unsqueeze(0).expand({3, 9});
  const auto t = SampleFromBins(edges, torch::zeros({3, 8}), 16, false);
  CHECK(torch::allclose(t[2], (torch::arange(16) + 0.5) / 16.0, 1e-4, 1e-5));
  const auto spike =
      SampleFromBins(edges, torch::tensor({0.f, 0.f, 0.f, 1e12f, 0.f, 0.f, 0.f, 0.f}).expand({3, 8}), 16, true);
  CHECK(torch::isfinite(spike).all().item<bool>());
  CHECK(spike.min().item<float>() >= 0.375f);
  CHECK(spike.max().item<float>() <= 0.5f);
}

TEST_CASE("hierarchical samples are sorted, keep the first pass and gather where the weight is") {
  torch::manual_seed(3);
  const auto near = torch::zeros({6}, torch::kFloat64), far = torch::ones({6}, torch::kFloat64);
  const auto t = StratifiedSamples(near, far, 32, true);
  const auto weights = torch::exp(-(t - 0.6).square() / 0.001).requires_grad_(true);
  const auto merged = HierarchicalSamples(t, weights, 64, true);
  CHECK(merged.sizes() == torch::IntArrayRef({6, 96}));
  CHECK_FALSE(merged.requires_grad());
  CHECK((merged.diff(1, 1) >= 0).all().item<bool>());
  CHECK(((merged - 0.6).abs() < 0.12).sum(1).min().item<int64_t>() >= 60);
  const auto nearest = (merged.unsqueeze(1) - t.unsqueeze(2)).abs().amin(2);
  CHECK(nearest.max().item<double>() == 0);
  CHECK_THROWS_AS(HierarchicalSamples(t.narrow(1, 0, 2), weights.narrow(1, 0, 2), 4, true), ShapeError);
}

TEST_CASE("interval lengths end at far and are never negative") {
  const auto t = torch::tensor({{0.25, 0.5, 1.5}}, torch::kFloat64);
  CHECK(torch::allclose(IntervalLengths(t, torch::full({1}, 2.0, torch::kFloat64)),
                        torch::tensor({{0.25, 1.0, 0.5}}, torch::kFloat64)));
  CHECK(IntervalLengths(t, torch::ones({1}, torch::kFloat64)).min().item<double>() == 0);
}
