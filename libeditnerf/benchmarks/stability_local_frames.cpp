// Coordinates in the frames of parts that turn with their key points, from still and coincident key points to scenes of
// any size: sum_i w_i R_i(k_i) (x - k_i), and its gradient with respect to the key points.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/field/key_points.h"
#include "libeditnerf/field/local_frames.h"
#include "libeditnerf/kernels/tile_functions.h"

namespace editnerf {
namespace {

constexpr int64_t kFrames = 12, kKeyPoints = 4, kSamples = 96;
using Complex = std::complex<Real>;
using Vector = std::array<Complex, 3>;

struct Situation {
  std::string name;
  torch::Tensor track;       // [F, N, 3] float64, what local coordinates are made from
  torch::Tensor key_points;  // [F, N, 3] float64, where they are asked for
};

// A part of the field, as given to every variant: in their precision.
struct Parts {
  KeyPointTable table;
  LocalFrames frames;
  torch::Tensor x, weights, state, upstream;  // [S, 3], [S, N], [S], [S, 3]
};

struct Turned {
  torch::Tensor out, gradient;  // [S, 3], [F, N, 3]
};

std::vector<Situation> AllSituations() {
  const auto track = torch::randn({kFrames, kKeyPoints, 3}, torch::kFloat64);
  const auto first = track.slice(0, 0, 1).expand_as(track), alone = track.slice(1, 0, 1).expand_as(track);
  return {{"moving", track, track},
          {"still", first, first},
          {"coincident", alone, alone},
          {"scene of 1e-4", track * 1e-4, track * 1e-4},
          {"scene of 1e4", track * 1e4, track * 1e4},
          {"1e4 outside their range", track, track * 1e4},
          {"1e30 outside their range", track, track * 1e30}};
}

// Turns of up to some times pi.
Parts PartsOf(const Situation& situation, const Precision& precision) {
  torch::manual_seed(14);
  const auto drawn = [&](at::IntArrayRef sizes) { return torch::randn(sizes, torch::kFloat64).to(precision.type); };
  Parts parts = {KeyPointTable(situation.track.to(precision.type)), LocalFrames(kKeyPoints), {}, {}, {}, {}};
  {
    const torch::NoGradGuard no_grad;
    parts.frames->to(precision.type);
    auto parameters = parts.frames->named_parameters();
    parameters["output_weight"].copy_(drawn({kKeyPoints, 32, 3}) * 0.3);
    parameters["output_bias"].copy_(drawn({kKeyPoints, 1, 3}) * 2);
  }
  parts.state = torch::randint(kFrames, {kSamples}, torch::kInt64);
  const auto near = situation.key_points.index_select(0, parts.state).select(1, 1).to(precision.type);
  parts.x = near + drawn({kSamples, 3}) * situation.track.abs().max().item<double>();
  parts.weights = torch::softmax(drawn({kSamples, kKeyPoints}), 1);
  parts.upstream = drawn({kSamples, 3});
  return parts;
}

Vector Cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// exp([r])^T v by the conjugate of the unit quaternion of r, whose parts are power series: no angle, and no division.
Vector TurnedBack(const Vector& r, const Vector& v) {
  const Complex quarter = (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) / static_cast<Real>(4);
  Complex cosine = 1, sine = 1, even = 1, odd = 1;  // of half the angle; the sine is divided by it
  for (int k = 1; k <= 60; ++k) {
    cosine += even *= -quarter / static_cast<Real>((2 * k - 1) * (2 * k));
    sine += odd *= -quarter / static_cast<Real>((2 * k) * (2 * k + 1));
  }
  Vector u, turned = v;
  for (size_t i = 0; i < 3; ++i) u[i] = -sine * r[i] / static_cast<Real>(2);
  const Vector once = Cross(u, v), twice = Cross(u, once);
  for (size_t i = 0; i < 3; ++i) turned[i] += static_cast<Real>(2) * (cosine * once[i] + twice[i]);
  return turned;
}

// Slopes by a step of 1e-40 along the imaginary axis, relative to the scale of what is differentiated.
Turned Expected(const Parts& parts, const torch::Tensor& key_points) {
  const auto in_double = [](const torch::Tensor& tensor) { return tensor.detach().to(torch::kFloat64).contiguous(); };
  const auto parameters = parts.frames->named_parameters();
  const auto hidden = in_double(parameters["hidden_weight"]), hidden_bias = in_double(parameters["hidden_bias"]),
             output = in_double(parameters["output_weight"]), output_bias = in_double(parameters["output_bias"]),
             scale = in_double(parts.table->scale), offset = in_double(parts.table->offset), x = in_double(parts.x),
             weights = in_double(parts.weights), upstream = in_double(parts.upstream), keys = in_double(key_points);
  const int64_t width = hidden.size(2);
  const auto at = [](const torch::Tensor& tensor, int64_t i) {
    return static_cast<Real>(tensor.data_ptr<double>()[i]);
  };
  const Real step = std::pow(static_cast<Real>(10), -40);
  Turned expected = {torch::zeros({kSamples, 3}, torch::kFloat64),
                     torch::zeros({kFrames, kKeyPoints, 3}, torch::kFloat64)};
  for (int64_t f = 0; f < kFrames; ++f) {
    for (int64_t n = 0; n < kKeyPoints; ++n) {
      for (int64_t axis = 0; axis < 3; ++axis) {
        Vector k, r;
        for (int64_t i = 0; i < 3; ++i) {
          k[static_cast<size_t>(i)] = {at(keys, (f * kKeyPoints + n) * 3 + i), i == axis ? step : 0};
          r[static_cast<size_t>(i)] = at(output_bias, 3 * n + i);
        }
        for (int64_t h = 0; h < width; ++h) {
          Complex sum = at(hidden_bias, n * width + h);
          for (int64_t i = 0; i < 3; ++i) {
            const Complex local = at(scale, n) * k[static_cast<size_t>(i)] + at(offset, 3 * n + i);
            sum += at(hidden, (n * 3 + i) * width + h) * local;
          }
          // The derivative of tanh by itself: that of complex numbers overflows.
          const Real bent = std::tanh(sum.real()), fall = 1 / std::cosh(std::min<Real>(std::abs(sum.real()), 5000));
          const Complex fired = {bent, fall * fall * sum.imag()};
          for (int64_t i = 0; i < 3; ++i) r[static_cast<size_t>(i)] += at(output, (n * width + h) * 3 + i) * fired;
        }
        for (int64_t s = 0; s < kSamples; ++s) {
          if (parts.state[s].item<int64_t>() != f) continue;
          Vector apart;
          for (int64_t i = 0; i < 3; ++i) apart[static_cast<size_t>(i)] = at(x, 3 * s + i) - k[static_cast<size_t>(i)];
          const Vector turned = TurnedBack(r, apart);
          for (int64_t i = 0; i < 3; ++i) {
            const Complex share = at(weights, s * kKeyPoints + n) * turned[static_cast<size_t>(i)];
            if (axis == 0) expected.out.data_ptr<double>()[3 * s + i] += static_cast<double>(share.real());
            expected.gradient.data_ptr<double>()[(f * kKeyPoints + n) * 3 + axis] +=
                static_cast<double>(at(upstream, 3 * s + i) * share.imag() / step);
          }
        }
      }
    }
  }
  return expected;
}

Turned ByModules(Parts& parts, const torch::Tensor& key_points) {
  const auto keys = key_points.clone().requires_grad_(true);
  const auto out =
      InLocalFrames(parts.x, parts.weights, keys, parts.frames->forward(parts.table->ToLocal(keys)), parts.state);
  return {out.detach(), torch::autograd::grad({(out * parts.upstream).sum()}, {keys})[0]};
}

// Frames from the module, as for every step, and samples by the kernels.
Turned ByTile(Parts& parts, const torch::Tensor& key_points) {
  const auto keys = key_points.clone().requires_grad_(true);
  const auto frames = parts.frames->forward(parts.table->ToLocal(keys));
  const auto of_samples = [&](const torch::Tensor& states) {
    return states.detach().index_select(0, parts.state).reshape({kSamples, -1}).t();
  };
  TileMemory x(3), weights(kKeyPoints), k(3 * kKeyPoints), r(9 * kKeyPoints), out(3), grad(3), to_weights(kKeyPoints),
      to_keys(3 * kKeyPoints), to_frames(9 * kKeyPoints);
  FillTile(parts.x.t(), &x);
  FillTile(parts.weights.t(), &weights);
  FillTile(of_samples(keys), &k);
  FillTile(of_samples(frames), &r);
  FillTile(parts.upstream.t(), &grad);
  SumInFrames(x.rows(), weights.rows(), k.rows(), r.rows(), kKeyPoints, kSamples, out.rows());
  SumInFramesGradient(x.rows(), weights.rows(), k.rows(), r.rows(), kKeyPoints, kSamples, grad.rows(),
                      to_weights.rows(), to_keys.rows(), to_frames.rows());
  const auto to_states = [&](const TileMemory& tile, const torch::Tensor& states) {
    const auto rows = ReadTile(tile, states[0].numel(), kSamples).t();
    return torch::zeros({kFrames, states[0].numel()}).index_add(0, parts.state, rows).view(states.sizes());
  };
  const auto through_frames = torch::autograd::grad({frames}, {keys}, {to_states(to_frames, frames)})[0];
  return {ReadTile(out, 3, kSamples).t(), to_states(to_keys, keys) + through_frames};
}

}  // namespace

StabilityRows LocalFrameStability() {
  torch::manual_seed(13);
  StabilityRows rows;
  for (const Situation& situation : AllSituations()) {
    for (const Precision& precision : Precisions()) {
      const auto key_points = situation.key_points.to(precision.type);
      Parts parts = PartsOf(situation, precision);
      const Turned expected = Expected(parts, key_points);
      // Local coordinates are differences of numbers of this size, which the turns follow.
      const double size = (parts.table->scale.view({1, -1, 1}) * key_points).abs().max().item<double>();
      const double bound = 64 * precision.rounding * (1 + std::min(size, 100.0));  // beyond, turns hardly move any more
      // Relative to the largest of all, as weighted sums cancel.
      const auto error = [](const torch::Tensor& found, const torch::Tensor& wanted) {
        return LargestErrorOfRows(found.reshape({1, -1}), wanted.reshape({1, -1}), 1e-30);
      };
      const auto add = [&](const std::string& variant, const Turned& found) {
        rows.push_back({"local frames",
                        situation.name,
                        variant,
                        {error(found.out, expected.out), bound},
                        ErrorAndBound{error(found.gradient, expected.gradient), bound},
                        AllFinite({found.out, found.gradient})});
      };
      add("LibTorch " + precision.name, ByModules(parts, key_points));
      if (precision.type == torch::kFloat64) continue;
      ForEachInstructionSet([&](const std::string& target) { add("kernel " + target, ByTile(parts, key_points)); });
    }
  }
  return rows;
}

}  // namespace editnerf
