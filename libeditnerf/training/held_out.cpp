#include "libeditnerf/training/held_out.h"

#include <cmath>

#include "libeditnerf/scene/timeline.h"
#include "libeditnerf/training/generator_guard.h"

namespace editnerf {
namespace {

constexpr int64_t kChunk = 4096;
constexpr uint64_t kSeed = 2023;  // of the held-out rays: the same in every run

}  // namespace

FrameStates StatesOfFrames(RadianceField& field, const Scene& scene, const std::vector<int64_t>& frames,
                           torch::Device device) {
  std::vector<int64_t> before, after;
  std::vector<double> weight;
  for (const int64_t frame : frames) {
    const TimelinePosition position = LocateInTime(scene, frame);
    before.push_back(position.before);
    after.push_back(position.after);
    weight.push_back(position.weight);
  }
  const auto rows = [&](const std::vector<int64_t>& index) { return torch::tensor(index, torch::kInt64).to(device); };
  const FrameStates first = field.States(rows(before)), second = field.States(rows(after));
  const torch::Tensor blend = torch::tensor(weight, torch::kFloat32).to(device);
  const auto mix = [&](const torch::Tensor& a, const torch::Tensor& b) {
    if (!a.defined()) return a;
    std::vector<int64_t> shape(static_cast<size_t>(a.dim()), 1);
    shape[0] = -1;
    return torch::lerp(a, b, blend.to(a.scalar_type()).view(shape));
  };
  return {mix(first.warp_code, second.warp_code), mix(first.appearance_code, second.appearance_code),
          mix(first.key_points, second.key_points)};
}

HeldOut::HeldOut(const Scene& scene, int64_t num_rays, torch::Device device) : scene_(scene), device_(device) {
  if (scene.val.empty()) return;
  const GeneratorGuard guard(kSeed);
  rays_ = TrainingRays(scene, scene.val, device).Sample(num_rays);
}

HeldOut::HeldOut(const Scene& scene, const torch::Tensor& pixels, int64_t num_rays, torch::Device device)
    : scene_(scene), device_(device) {
  if (scene.val.empty() || pixels.size(0) == 0) return;
  const GeneratorGuard guard(kSeed);
  const torch::Tensor chosen = torch::randperm(pixels.size(0)).slice(0, 0, num_rays);
  rays_ = TrainingRays(scene, scene.val, device).Through(pixels.cpu().index_select(0, chosen).to(device));
}

std::optional<double> HeldOut::Psnr(RadianceField& field, RayRenderer& renderer) const {
  if (!rays_) return std::nullopt;
  const torch::NoGradGuard no_grad;
  const GeneratorGuard guard(kSeed);
  const FrameStates states = StatesOfFrames(field, scene_, scene_.val, device_);
  RayOptions options;
  options.surface = false;
  double sum = 0;
  const int64_t count = rays_->frame.size(0);
  for (int64_t begin = 0; begin < count; begin += kChunk) {
    const int64_t end = std::min(count, begin + kChunk);
    const RayBatch rays = {rays_->rays.origin.slice(0, begin, end), rays_->rays.direction.slice(0, begin, end),
                           rays_->frame.slice(0, begin, end)};
    const RayResult result = renderer.Render(field, rays, states, options);
    sum += (result.rgb - rays_->target.slice(0, begin, end)).pow(2).sum().item<double>();
  }
  const double mse = sum / static_cast<double>(3 * count);
  return -10 * std::log10(std::max(mse, 1e-12));
}

}  // namespace editnerf
