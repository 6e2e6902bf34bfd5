#include "libeditnerf/tracking/clip.h"

#include <cmath>

#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/still_flow.h"

namespace editnerf {
namespace {

constexpr int64_t kCachedBytes = int64_t{256} << 20;  // of flow; the same pairs are asked for by many candidates

float Bilinear(const float* values, int64_t width, double u, double v) {
  const double x = u - 0.5, y = v - 0.5;
  const auto column = static_cast<int64_t>(std::floor(x)), row = static_cast<int64_t>(std::floor(y));
  const auto fx = static_cast<float>(x - std::floor(x)), fy = static_cast<float>(y - std::floor(y));
  const float* p = values + row * width + column;
  return (1 - fy) * ((1 - fx) * p[0] + fx * p[1]) + fy * ((1 - fx) * p[width] + fx * p[width + 1]);
}

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

double PatchSimilarity(const torch::Tensor& gray_a, const Pixel& a, const torch::Tensor& gray_b, const Pixel& b,
                       int64_t radius) {
  const auto margin = static_cast<double>(radius) + 0.5;
  const auto fits = [margin](const torch::Tensor& gray, const Pixel& p) {
    return p.u - margin >= 0 && p.v - margin >= 0 && p.u + margin + 1 < static_cast<double>(gray.size(1)) &&
           p.v + margin + 1 < static_cast<double>(gray.size(0));
  };
  if (!fits(gray_a, a) || !fits(gray_b, b)) return 0;
  const float* values_a = gray_a.data_ptr<float>();
  const float* values_b = gray_b.data_ptr<float>();
  double sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0, count = 0;
  for (int64_t dy = -radius; dy <= radius; ++dy) {
    for (int64_t dx = -radius; dx <= radius; ++dx) {
      const auto ox = static_cast<double>(dx), oy = static_cast<double>(dy);
      const double va = Bilinear(values_a, gray_a.size(1), a.u + ox, a.v + oy);
      const double vb = Bilinear(values_b, gray_b.size(1), b.u + ox, b.v + oy);
      sum_a += va, sum_b += vb, sum_aa += va * va, sum_bb += vb * vb, sum_ab += va * vb, count += 1;
    }
  }
  const double variance_a = sum_aa / count - sum_a * sum_a / (count * count);
  const double variance_b = sum_bb / count - sum_b * sum_b / (count * count);
  constexpr double kLeastVariance = 1.0;  // grey levels squared: below it there is only noise
  if (variance_a < kLeastVariance || variance_b < kLeastVariance) return 0;
  return (sum_ab / count - sum_a * sum_b / (count * count)) / std::sqrt(variance_a * variance_b);
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
