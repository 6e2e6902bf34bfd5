#include "libeditnerf/field/local_frames.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/field/hinge_way.h"
#include "libeditnerf/geometry/se3.h"

namespace editnerf {
namespace {

constexpr int64_t kHidden = 32;
// The hidden layer bends about as often as a hinge's way does over its range of about 1; a fit of the output layer
// alone then follows known turns, and what lies beyond them goes on smoothly.
constexpr double kHiddenScale = 1.5;
// Of the squared weights, for each frame: turns are known to a fifth of a degree, and are met to a twentieth. A hundred
// times as much leaves up to two degrees.
constexpr double kRidge = 1e-5;
// How far the way of a hinge is continued, share of it: the layer alone is a degree off a tenth beyond its end.
constexpr double kBeyond = 0.2;

torch::Tensor HiddenLayer(const torch::Tensor& coordinates, const torch::Tensor& weight, const torch::Tensor& bias) {
  return torch::tanh(torch::matmul(coordinates, weight) + bias);
}

}  // namespace

LocalFramesImpl::LocalFramesImpl(int64_t num_key_points) {
  if (num_key_points < 1) Throw<ConfigError>("local frames: expected key points, found {}", num_key_points);
  hidden_weight_ = register_parameter("hidden_weight", torch::randn({num_key_points, 3, kHidden}) * kHiddenScale);
  hidden_bias_ = register_parameter("hidden_bias", (2 * torch::rand({num_key_points, 1, kHidden}) - 1) * kHiddenScale);
  output_weight_ = register_parameter("output_weight", torch::zeros({num_key_points, kHidden, 3}));
  output_bias_ = register_parameter("output_bias", torch::zeros({num_key_points, 1, 3}));
}

LocalFramesImpl::LocalFramesImpl(const torch::Tensor& coordinates, const torch::Tensor& turns)
    : LocalFramesImpl(coordinates.size(1)) {
  CheckShape(coordinates, {kAny, num_key_points(), 3}, "local frames coordinates");
  CheckShape(turns, {coordinates.size(0), num_key_points(), 3}, "local frames turns");
  if (!turns.isfinite().all().item<bool>() || !coordinates.isfinite().all().item<bool>()) {
    Throw<DataError>("local frames: turns or key points that are not finite");
  }
  for (int64_t i = 0; i < num_key_points(); ++i) Fit(i, coordinates.select(1, i), turns.select(1, i));
}

// Least squares for the output layer, with a little weight decay and without any for the bias.
void LocalFramesImpl::Fit(int64_t key_point, const torch::Tensor& coordinates, const torch::Tensor& turns) {
  const torch::NoGradGuard no_grad;
  const HingeWay beyond = BeyondHinge(coordinates.detach(), turns.detach(), kBeyond);
  const torch::Tensor at =
      torch::cat({coordinates.detach().to(torch::kFloat32), beyond.coordinates.to(torch::kFloat32)});
  const torch::Tensor known = torch::cat({turns.detach().to(torch::kFloat64), beyond.turns}),
                      middle = known.mean(0, true);
  const torch::Tensor hidden = HiddenLayer(at, hidden_weight_[key_point], hidden_bias_[key_point]).to(torch::kFloat64);
  const torch::Tensor mean = hidden.mean(0, true), features = hidden - mean;
  const torch::Tensor square = torch::matmul(features.t(), features) +
                               kRidge * static_cast<double>(at.size(0)) * torch::eye(kHidden, torch::kFloat64);
  const torch::Tensor weight = torch::matmul(torch::linalg_inv(square), torch::matmul(features.t(), known - middle));
  output_weight_[key_point].copy_(weight);
  output_bias_[key_point].copy_(middle - torch::matmul(mean, weight));
}

torch::Tensor LocalFramesImpl::Hidden(const torch::Tensor& coordinates) const {
  return HiddenLayer(coordinates.transpose(0, 1), hidden_weight_, hidden_bias_);
}

torch::Tensor LocalFramesImpl::RotationVectors(const torch::Tensor& coordinates) {
  CheckShape(coordinates, {kAny, num_key_points(), 3}, "local frames coordinates");
  return (torch::matmul(Hidden(coordinates), output_weight_) + output_bias_).transpose(0, 1);
}

torch::Tensor LocalFramesImpl::forward(const torch::Tensor& coordinates) {
  // Row i of the result is exp([r]) applied to axis i: together the transpose of exp([r]).
  return ExpSo3(RotationVectors(coordinates).unsqueeze(2), torch::eye(3, coordinates.options()).view({1, 1, 3, 3}));
}

torch::Tensor InLocalFrames(const torch::Tensor& x, const torch::Tensor& weights, const torch::Tensor& key_points,
                            const torch::Tensor& frames, const torch::Tensor& state) {
  const int64_t samples = x.size(0), number = key_points.size(1);
  CheckShape(x, {samples, 3}, "local frames x");
  CheckShape(state, {samples}, "local frames state");
  CheckShape(frames, {key_points.size(0), number, 3, 3}, "local frames");
  const torch::Tensor apart = x.unsqueeze(1) - key_points.index_select(0, state);
  const torch::Tensor turned = torch::matmul(frames.index_select(0, state), apart.unsqueeze(-1)).squeeze(-1);
  if (!weights.defined()) return turned.squeeze(1);
  CheckShape(weights, {samples, number}, "local frames weights");
  return (weights.unsqueeze(-1) * turned).sum(1);
}

torch::Tensor UnwrapTurns(const torch::Tensor& turns) {
  CheckShape(turns, {kAny, kAny, 3}, "turns");
  torch::Tensor unwrapped = turns.to(torch::kCPU, torch::kFloat64).clone();
  for (int64_t t = 1; t < turns.size(0); ++t) {
    const torch::Tensor before = unwrapped[t - 1], angle = unwrapped[t].norm(2, -1, true);
    // About the axis of a turn by next to nothing, that of the frame before.
    const torch::Tensor axis = torch::where(angle > 1e-6, unwrapped[t] / angle.clamp_min(1e-6),
                                            before / before.norm(2, -1, true).clamp_min(1e-6));
    const torch::Tensor wanted = (before * axis).sum(-1, true);
    const torch::Tensor signed_angle = torch::where(angle > 1e-6, angle, torch::zeros_like(angle));
    const torch::Tensor whole = ((wanted - signed_angle) / (2 * M_PI)).round();
    unwrapped[t].copy_(axis * (signed_angle + 2 * M_PI * whole));
  }
  return unwrapped;
}

}  // namespace editnerf
