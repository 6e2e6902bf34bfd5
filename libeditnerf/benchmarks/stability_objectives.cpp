// What training wants of rays beside their colours, and where rays end.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/kernels/packed_compositing.h"
#include "libeditnerf/render/compositing.h"
#include "libeditnerf/render/ray_marcher.h"

namespace editnerf {
namespace {

constexpr int64_t kSamples = 256, kRays = 16;
constexpr double kRoundings = 128;  // of a loss or gradient: running sums, that cancel where light ends in one place

struct Weights {
  std::string name;
  torch::Tensor weights;  // [R, S] float64
};

struct Distorted {
  torch::Tensor loss, gradient;  // [R, 1], [R, S]
};

std::vector<Weights> AllWeights() {
  torch::manual_seed(11);
  const auto options = torch::kFloat64;
  auto surface = torch::zeros({kRays, kSamples}, options);
  for (int64_t r = 0; r < kRays; ++r) {
    surface[r][16 * r] = 0.75;
    surface[r][16 * r + 1] = 0.25;
  }
  auto ends = torch::zeros({kRays, kSamples}, options);
  ends.select(1, 0).fill_(0.5), ends.select(1, kSamples - 1).fill_(0.5);
  const auto drawn = torch::pow(10.0, torch::rand({kRays, kSamples}, options) * 12 - 12);
  return {{"fog: equal weights", torch::full({kRays, kSamples}, 1.0 / kSamples, options)},
          {"fog: 1e-12 to 1, drawn", drawn / drawn.sum(1, true)},
          {"thin: 1e-12 in all", torch::full({kRays, kSamples}, 1e-12 / kSamples, options)},
          {"a surface, at every distance", surface},
          {"half at either end", ends},
          {"nothing", torch::zeros({kRays, kSamples}, options)}};
}

// Pair by pair.
Distorted Expected(const torch::Tensor& weights, const torch::Tensor& s, const torch::Tensor& d) {
  Distorted expected = {torch::empty({kRays, 1}, torch::kFloat64), torch::empty_like(weights)};
  const double* const t = s.data_ptr<double>();
  for (int64_t r = 0; r < kRays; ++r) {
    const double *const w = weights.data_ptr<double>() + r * kSamples, *const length =
                                                                           d.data_ptr<double>() + r * kSamples;
    Real loss = 0;
    for (int64_t i = 0; i < kSamples; ++i) {
      Real apart = 0;
      for (int64_t j = 0; j < kSamples; ++j) {
        apart += w[j] * std::abs(static_cast<Real>(t[r * kSamples + i]) - t[r * kSamples + j]);
      }
      loss += w[i] * (apart + static_cast<Real>(w[i]) * length[i] / 3);
      expected.gradient.data_ptr<double>()[r * kSamples + i] =
          static_cast<double>(2 * apart + 2 * static_cast<Real>(w[i]) * length[i] / 3);
    }
    expected.loss[r][0] = static_cast<double>(loss);
  }
  return expected;
}

Distorted Differentiated(const torch::Tensor& weights, const std::function<torch::Tensor(const torch::Tensor&)>& loss) {
  const auto leaf = weights.clone().requires_grad_(true);
  const auto value = loss(leaf);
  return {value.detach().unsqueeze(1), torch::autograd::grad({value.sum()}, {leaf})[0]};
}

struct Densities {
  std::string name;
  torch::Tensor density;  // [R, S]
};

// Samples that are kept against the rule, relative to all: light is multiplied on; a hair's breadth from the end
// either is right.
double WronglyKept(const torch::Tensor& density, double delta, double early_stop, const PackedSamples& kept,
                   const torch::Tensor& t) {
  constexpr Real kHair = 1e-6;
  int64_t wrong = 0;
  for (int64_t r = 0; r < kRays; ++r) {
    const int64_t first = kept.offsets[r].item<int64_t>(), count = kept.offsets[r + 1].item<int64_t>() - first;
    Real light = 1;
    for (int64_t i = 0; i < kSamples; ++i) {
      const bool is_kept = i < count;
      if (is_kept) wrong += static_cast<int64_t>(kept.t[first + i].item<double>() != t[i].item<double>());
      if (is_kept ? light < early_stop * (1 - kHair) : light > early_stop * (1 + kHair)) ++wrong;
      light *= std::exp(-static_cast<Real>(density[r][i].item<double>()) * static_cast<Real>(delta));
    }
  }
  return static_cast<double>(wrong) / static_cast<double>(kRays * kSamples);
}

}  // namespace

StabilityRows DistortionStability() {
  StabilityRows rows;
  for (const Weights& situation : AllWeights()) {
    for (const Precision& precision : Precisions()) {
      const auto given = [&](const torch::Tensor& tensor) { return tensor.to(precision.type).contiguous(); };
      const auto exact = [&](const torch::Tensor& tensor) { return given(tensor).to(torch::kFloat64); };
      const auto s = ((torch::arange(kSamples, torch::kFloat64) + 0.5) / kSamples).expand({kRays, kSamples});
      const auto d = torch::full({kRays, kSamples}, 1.0 / kSamples, torch::kFloat64);
      const auto expected = Expected(exact(situation.weights), exact(s), exact(d));
      const auto add = [&](const std::string& variant, const Distorted& found) {
        const double bound = kRoundings * precision.rounding;
        rows.push_back({"distortion",
                        situation.name,
                        variant,
                        {LargestRelativeError(found.loss, expected.loss, 1e-30), bound},
                        ErrorAndBound{LargestErrorOfRows(found.gradient, expected.gradient, 1e-30), bound},
                        AllFinite({found.loss, found.gradient})});
      };
      add("LibTorch " + precision.name, Differentiated(given(situation.weights), [&](const torch::Tensor& w) {
            return DistortionLoss(w, given(s), given(d));
          }));
      const auto offsets = torch::arange(kRays + 1, torch::kInt64) * kSamples;
      add("packed " + precision.name, Differentiated(given(situation.weights), [&](const torch::Tensor& w) {
            return PackedDistortion(w.reshape({-1}), given(s).view({-1}), given(d).view({-1}), offsets);
          }));
    }
  }
  return rows;
}

StabilityRows EarlyStopStability() {
  torch::manual_seed(12);
  constexpr double kDelta = 0.01, kEarlyStop = 1e-3;
  const auto exponents = torch::linspace(-12, 12, kRays, torch::kFloat64).unsqueeze(1).expand({kRays, kSamples});
  const auto drawn = torch::rand({kRays, kSamples}, torch::kFloat64) * 24 - 12;
  auto opaque = torch::full({kRays, kSamples}, 1e-6, torch::kFloat64);
  for (int64_t r = 0; r < kRays; ++r) opaque[r][16 * r] = 1e12;
  const std::vector<Densities> situations = {{"equal, 1e-12 to 1e12", torch::pow(10.0, exponents)},
                                             {"mixed, 1e-12 to 1e12", torch::pow(10.0, drawn)},
                                             {"one opaque among thin", opaque},
                                             {"all zero", torch::zeros({kRays, kSamples}, torch::kFloat64)}};
  const auto t = torch::arange(kSamples, torch::kFloat64) * kDelta;
  StabilityRows rows;
  for (const Densities& situation : situations) {
    for (const Precision& precision : Precisions()) {
      const auto density = situation.density.to(precision.type).contiguous();
      PackedSamples all;
      all.t = t.to(precision.type).repeat({kRays});
      all.delta = torch::full_like(all.t, kDelta);
      all.ray = torch::arange(kRays, torch::kInt64).repeat_interleave(kSamples);
      all.offsets = torch::arange(kRays + 1, torch::kInt64) * kSamples;
      const auto kept = MarchUntilOpaque(all, kEarlyStop, [&](const PackedSamples& wave) {
        const auto column = torch::bucketize(wave.t, t.to(precision.type));
        return density.index({wave.ray, column});
      });
      const double wrong = WronglyKept(density, all.delta[0].item<double>(), kEarlyStop, kept, t.to(precision.type));
      rows.push_back({"early stop", situation.name, "LibTorch " + precision.name, {wrong, 0}, {}, AllFinite({kept.t})});
    }
  }
  return rows;
}

}  // namespace editnerf
