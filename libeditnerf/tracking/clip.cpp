#include "libeditnerf/tracking/clip.h"

#include <cmath>

#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/still_flow.h"

namespace editnerf {
namespace {

constexpr int64_t kCachedBytes = int64_t{256} << 20;  // of flow; the same pairs are asked for by many candidates

}  // namespace

FlowSample Clip::Step(int64_t t, int64_t step, const Pixel& p) const {
  const int64_t pair = step > 0 ? t : t - 1;
  if (pair < 0 || pair + 1 >= num_frames()) return {};
  const auto i = static_cast<size_t>(pair);
  return step > 0 ? SampleFlow(forward[i], forward_valid[i], p) : SampleFlow(backward[i], backward_valid[i], p);
}

Vec3 Clip::Lift(int64_t t, const Pixel& p, double distance) const {
  const Camera& camera = cameras[static_cast<size_t>(t)];
  return camera.position + camera.DirectionThrough(p.u, p.v) * distance;
}

Clip MakeClip(const Scene& scene, const torch::Tensor& depth, const FlowSequence& flows) {
  const auto frames = static_cast<int64_t>(scene.train.size());
  const int64_t height = scene.height(), width = scene.width();
  CheckShape(depth, {frames, height, width}, "pretrained depth");
  CheckShape(flows.forward, {frames - 1, height, width, 2}, "forward flow");
  CheckShape(flows.backward, {frames - 1, height, width, 2}, "backward flow");
  CheckShape(flows.forward_valid, {frames - 1, height, width}, "forward validity");
  CheckShape(flows.backward_valid, {frames - 1, height, width}, "backward validity");
  Clip clip;
  clip.width = width;
  clip.height = height;
  for (const int64_t index : scene.train) {
    clip.cameras.push_back(scene.frames[static_cast<size_t>(index)].camera);
    clip.images.push_back(scene.images[index].contiguous());
    clip.gray.push_back(clip.images.back().to(torch::kFloat32).mean(2).contiguous());
  }
  clip.depth = depth.to(torch::kFloat32).contiguous().unbind(0);
  clip.forward = flows.forward.contiguous().unbind(0);
  clip.backward = flows.backward.contiguous().unbind(0);
  clip.forward_valid = flows.forward_valid.contiguous().unbind(0);
  clip.backward_valid = flows.backward_valid.contiguous().unbind(0);
  return clip;
}

const torch::Tensor& DirectFlows::Get(int64_t from, int64_t to) {
  const auto key = std::make_pair(from, to);
  const auto found = cache_.find(key);
  if (found != cache_.end()) return found->second;
  const int64_t bytes = clip_.height * clip_.width * 2 * static_cast<int64_t>(sizeof(float));
  if (static_cast<int64_t>(cache_.size() + 1) * bytes > kCachedBytes) cache_.clear();
  const auto a = static_cast<size_t>(from), b = static_cast<size_t>(to);
  const torch::Tensor guess = StillFlow(clip_.cameras[a], clip_.depth[a], clip_.cameras[b]);
  return cache_[key] = flow_.FlowFrom(clip_.images[a], clip_.images[b], guess).contiguous();
}

DirectFlows::Match DirectFlows::Find(int64_t from, int64_t to, const Pixel& p) {
  Match match;
  const FlowSample there = SampleFlow(Get(from, to), {}, p);
  if (!there.valid) return match;
  match.pixel = {p.u + there.du, p.v + there.dv};
  const FlowSample back = SampleFlow(Get(to, from), {}, match.pixel);
  if (!back.valid) return match;
  match.error = std::hypot(there.du + back.du, there.dv + back.dv);
  match.valid = true;
  return match;
}

}  // namespace editnerf
