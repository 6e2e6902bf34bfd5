#include "libeditnerf/field/key_points.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

void CheckFinite(const torch::Tensor& tracks) {
  const torch::Tensor broken = (~tracks.isfinite()).any(-1).nonzero().cpu();
  if (broken.size(0) == 0) return;
  Throw<DataError>("initial tracks: key point {} is not finite in frame {}; expected a position in every frame",
                   broken[0][1].item<int64_t>(), broken[0][0].item<int64_t>());
}

// [N] scene units: the largest of the axes' ranges between the 10th and the 90th percentile.
torch::Tensor TrackRanges(const torch::Tensor& tracks) {
  const torch::Tensor ends = torch::quantile(tracks, torch::tensor({0.1, 0.9}, tracks.options()), 0);
  return (ends[1] - ends[0]).amax(-1);
}

}  // namespace

KeyPointTableImpl::KeyPointTableImpl(const torch::Tensor& tracks) {
  CheckShape(tracks, {kAny, kAny, 3}, "tracks");
  if (tracks.size(0) < 1 || tracks.size(1) < 1) {
    Throw<ShapeError>("tracks: expected at least one frame and one key point, found {}", ShapeString(tracks));
  }
  const torch::NoGradGuard no_grad;
  const torch::Tensor initial = tracks.detach().to(torch::kFloat64);
  CheckFinite(initial);
  const torch::Tensor ranges = TrackRanges(initial);
  const torch::Tensor on_host = ranges.cpu();
  for (int64_t i = 0; i < on_host.size(0); ++i) {
    const double range = on_host[i].item<double>();
    if (range >= kSmallestTrackRange) continue;
    LogWarning(
        "key point {}: its initial track moves by {:.2g} scene units only; its local coordinates are scaled as for {}",
        i, range, kSmallestTrackRange);
  }
  const torch::Tensor s = 1 / ranges.clamp_min(kSmallestTrackRange);
  const torch::Tensor b = -s.unsqueeze(-1) * initial.mean(0);
  scale = register_buffer("scale", s.to(tracks.scalar_type()));
  offset = register_buffer("offset", b.to(tracks.scalar_type()));
  local = register_parameter("local", (initial * s.unsqueeze(-1) + b).to(tracks.scalar_type()));
}

KeyPointTableImpl::KeyPointTableImpl(int64_t num_frames, int64_t num_key_points) {
  if (num_frames < 1 || num_key_points < 1) {
    Throw<ConfigError>("key points: expected at least one frame and one key point, found {} and {}", num_frames,
                       num_key_points);
  }
  scale = register_buffer("scale", torch::ones({num_key_points}));
  offset = register_buffer("offset", torch::zeros({num_key_points, 3}));
  local = register_parameter("local", torch::zeros({num_frames, num_key_points, 3}));
}

torch::Tensor KeyPointTableImpl::Positions(const torch::Tensor& time) {
  CheckShape(time, {kAny}, "time");
  return FromLocal(local.index_select(0, time));
}

torch::Tensor KeyPointTableImpl::ToLocal(const torch::Tensor& key_points) const {
  CheckLastDim(key_points, 3, "key_points");
  CheckLastDim(key_points.select(-1, 0), num_key_points(), "key_points' axis before the last");
  return key_points * scale.unsqueeze(-1) + offset;
}

torch::Tensor KeyPointTableImpl::FromLocal(const torch::Tensor& coordinates) const {
  CheckLastDim(coordinates, 3, "coordinates");
  CheckLastDim(coordinates.select(-1, 0), num_key_points(), "coordinates' axis before the last");
  return (coordinates - offset) / scale.unsqueeze(-1);
}

torch::Tensor WeightedKeyPoint(const torch::Tensor& weights, const torch::Tensor& key_points,
                               const torch::Tensor& state) {
  CheckShape(key_points, {kAny, kAny, 3}, "key_points");
  CheckShape(state, {kAny}, "state");
  const int64_t count = key_points.size(1);
  if (!weights.defined()) {
    CheckShape(key_points, {kAny, 1, 3}, "key_points without weights");
    return key_points.squeeze(1).index_select(0, state);
  }
  CheckShape(weights, {state.size(0), count}, "weights");
  return (weights.unsqueeze(-1) * key_points.index_select(0, state)).sum(1);
}

}  // namespace editnerf
