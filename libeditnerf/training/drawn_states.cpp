#include "libeditnerf/training/drawn_states.h"

#include <torch/types.h>
#include <torch/utils.h>

namespace editnerf {
namespace {

constexpr int64_t kTries = 4;
constexpr double kMostOf = 0.98, kMargin = 1.15;  // of a part's places, which lie on what is seen of it

}  // namespace

torch::Tensor DrawKeyPoints(const torch::Tensor& key_points, const torch::Tensor& carrier, bool along_the_way) {
  const torch::NoGradGuard no_grad;
  const torch::Tensor known = key_points.detach();
  const int64_t frames = known.size(0), number = known.size(1), count = carrier.size(0);
  const auto pick = [&] { return torch::randint(frames, {count, number, 1}, torch::kInt64).to(known.device()); };
  const auto at = [&](const torch::Tensor& frame) { return known.gather(0, frame.expand({count, number, 3})); };
  const torch::Tensor visited = pick(), a = at(visited);
  const torch::Tensor b = at(along_the_way ? (visited + 1).clamp_max(frames - 1) : pick());
  const torch::Tensor drawn = torch::lerp(a, b, torch::rand({count, number, 1}).to(known));
  const torch::Tensor on_its_way = torch::arange(number, carrier.options()) == carrier.unsqueeze(1);
  return torch::where(on_its_way.unsqueeze(2), a, drawn);
}

torch::Tensor DrawKeyPointsClearOf(const ClearPlaces& places, const torch::Tensor& key_points, bool along_the_way) {
  const torch::NoGradGuard no_grad;
  if (!places.reach.defined()) return DrawKeyPoints(key_points, places.carrier, along_the_way);
  torch::Tensor drawn = key_points.detach().index_select(0, places.frame);
  torch::Tensor done = torch::zeros({drawn.size(0), drawn.size(1)}, places.carrier.options().dtype(torch::kBool));
  for (int64_t i = 0; i < kTries; ++i) {
    const torch::Tensor next = DrawKeyPoints(key_points, places.carrier, along_the_way);
    const torch::Tensor away = (next - places.place.unsqueeze(1)).norm(2, 2);
    const torch::Tensor clear = (away > places.reach) | (places.carrier >= 0).unsqueeze(1);
    drawn = torch::where((clear & ~done).unsqueeze(2), next, drawn);
    done = done | clear;
  }
  return drawn;
}

torch::Tensor PartReach(const torch::Tensor& places, const torch::Tensor& frame, const torch::Tensor& key_point,
                        const torch::Tensor& key_points) {
  const torch::NoGradGuard no_grad;
  torch::Tensor reach;
  for (int64_t i = 0; i < key_points.size(1); ++i) {
    const torch::Tensor rows = (key_point == i).nonzero().squeeze(1);
    if (rows.numel() == 0) continue;
    const torch::Tensor from = key_points.detach().select(1, i).index_select(0, frame.index_select(0, rows));
    if (!reach.defined()) reach = torch::zeros({key_points.size(1)}, from.options());
    reach[i] = kMargin * torch::quantile((places.index_select(0, rows) - from).norm(2, 1), kMostOf);
  }
  return reach;
}

FrameStates WithDrawn(FrameStates states, const torch::Tensor& drawn, const torch::Tensor& frame,
                      const torch::Tensor& carrier) {
  if (carrier.defined()) {
    const torch::Tensor known = states.key_points.detach(), stays = carrier.lt(0).view({-1, 1, 1});
    states.casters = torch::cat({known, torch::where(stays, known.index_select(0, frame), drawn)});
  }
  states.key_points = torch::cat({states.key_points, drawn});
  for (const auto code : {&FrameStates::warp_code, &FrameStates::appearance_code})
    if ((states.*code).defined()) states.*code = torch::cat({states.*code, (states.*code).index_select(0, frame)});
  return states;
}

}  // namespace editnerf
