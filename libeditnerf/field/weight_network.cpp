#include "libeditnerf/field/weight_network.h"

#include <torch/types.h>

#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

namespace {

constexpr int64_t kAnchors = 8;  // positions of each track, evenly spaced in time

// [N, kAnchors, 3]
torch::Tensor AnchorsOf(const torch::Tensor& tracks) {
  const torch::Tensor frames = torch::linspace(0, static_cast<double>(tracks.size(0) - 1), kAnchors).round();
  return tracks.index_select(0, frames.to(tracks.device(), torch::kInt64)).transpose(0, 1).contiguous();
}

// Median over all anchors of the distance to the nearest anchor of another track, not 0.
torch::Tensor SpacingOf(const torch::Tensor& anchors) {
  const int64_t count = anchors.size(0);
  const torch::Tensor flat = anchors.reshape({-1, 3});
  torch::Tensor distance = (flat.unsqueeze(1) - flat.unsqueeze(0)).norm(2, -1);
  const torch::Tensor track = torch::arange(count, torch::kInt64).repeat_interleave(kAnchors).to(flat.device());
  distance = distance.masked_fill(track.unsqueeze(1) == track.unsqueeze(0), std::numeric_limits<double>::infinity());
  return distance.amin(1).median().clamp_min(1e-3);
}

}  // namespace

WeightNetworkImpl::WeightNetworkImpl(const WeightNetworkConfig& config, int64_t num_key_points,
                                     const torch::Tensor& initial_tracks)
    : encoding_(3, config.num_octaves), mlp_(nullptr), prior_(config.distance_prior) {
  if (num_key_points < 2) {
    Throw<ConfigError>("weight network: num_key_points: expected 2 or more, found {}", num_key_points);
  }
  MlpOptions options;
  options.in = encoding_.output_dim();
  options.depth = config.depth;
  options.width = config.width;
  options.out = num_key_points;
  options.output_init = LayerInit::Normal(config.output_init);
  mlp_ = register_module("mlp", Mlp(options));
  if (prior_ == 0) return;
  torch::Tensor anchors = torch::zeros({num_key_points, kAnchors, 3}), spacing = torch::ones({});
  if (initial_tracks.defined()) {
    CheckShape(initial_tracks, {kAny, num_key_points, 3}, "weight network initial tracks");
    anchors = AnchorsOf(initial_tracks.detach().to(torch::kFloat32));
    spacing = SpacingOf(anchors);
  }
  anchors_ = register_buffer("anchors", anchors);
  spacing_ = register_buffer("spacing", spacing);
}

torch::Tensor WeightNetworkImpl::forward(const torch::Tensor& x_canonical) {
  CheckLastDim(x_canonical, 3, "x_canonical");
  torch::Tensor logits = mlp_->forward(std::vector<torch::Tensor>{encoding_.forward(x_canonical)});
  if (prior_ > 0) {
    const int64_t count = anchors_.size(0);
    // By differences: from products, short distances lose half their digits.
    constexpr int64_t kWithoutProducts = 2;
    const torch::Tensor distance =
        torch::cdist(x_canonical.reshape({-1, 3}), anchors_.reshape({-1, 3}), 2, kWithoutProducts);
    logits = logits - prior_ / spacing_ * distance.view({-1, count, kAnchors}).amin(-1).view(logits.sizes());
  }
  return torch::softmax(logits, -1);
}

void WeightNetworkImpl::AddTo(FusedField* field) const {
  field->weights = mlp_->Layers();
  field->weight_octaves = encoding_.num_octaves();
  if (prior_ == 0) return;
  field->anchors = anchors_;
  field->prior = static_cast<float>(prior_ / spacing_.item<double>());
}

}  // namespace editnerf
