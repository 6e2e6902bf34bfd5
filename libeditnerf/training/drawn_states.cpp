#include "libeditnerf/training/drawn_states.h"

#include <torch/torch.h>

namespace editnerf {

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

FrameStates WithDrawn(FrameStates states, const torch::Tensor& drawn, const torch::Tensor& frame) {
  states.key_points = torch::cat({states.key_points, drawn});
  for (const auto code : {&FrameStates::warp_code, &FrameStates::appearance_code})
    if ((states.*code).defined()) states.*code = torch::cat({states.*code, (states.*code).index_select(0, frame)});
  return states;
}

}  // namespace editnerf
