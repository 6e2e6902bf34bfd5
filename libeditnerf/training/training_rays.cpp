#include "libeditnerf/training/training_rays.h"

#include <cmath>

namespace editnerf {
namespace {

constexpr int64_t kGuidedShare = 4;  // one in so many rays goes through a pixel of known distance
constexpr double kBefore = 0.9;      // share of the distance to what stands still, before which parts may move

}  // namespace

TrainingRays::TrainingRays(const Scene& scene, const std::vector<int64_t>& frames, torch::Device device) {
  std::vector<Camera> cameras;
  for (const int64_t frame : frames) cameras.push_back(scene.frames[static_cast<size_t>(frame)].camera);
  cameras_ = StackCameras(cameras, torch::kFloat32, device);
  images_ = scene.images.index_select(0, torch::tensor(frames, torch::kInt64)).to(device);
  torch::Tensor sum = torch::zeros({3}, torch::TensorOptions(torch::kFloat64).device(device));
  for (int64_t frame = 0; frame < images_.size(0); ++frame)
    sum += images_[frame].mean(torch::IntArrayRef{0, 1}, false, torch::kFloat64);
  mean_color_ = (sum / (255.0 * static_cast<double>(images_.size(0)))).to(torch::kFloat32);
}

void TrainingRays::SetDepthTargets(const DepthTargets& targets) {
  targets_ = targets;
  if (targets_.size() == 0) return;
  const torch::Device device = images_.device();
  for (torch::Tensor* part : {&targets_.frame, &targets_.pixel, &targets_.distance, &targets_.tolerance})
    *part = part->to(device);
  target_pixel_ = PixelsOf(targets_);
}

void TrainingRays::SetStillPlaces(const DepthTargets& places, double share) {
  still_share_ = places.size() > 0 ? share : 0;
  if (places.size() == 0) return;
  still_pixel_ = PixelsOf(places).to(images_.device());
  still_distance_ = places.distance.to(images_.device());
}

torch::Tensor TrainingRays::PixelsOf(const DepthTargets& places) const {
  const int64_t height = images_.size(1), width = images_.size(2);
  return (places.frame * height + places.pixel.select(1, 1)) * width + places.pixel.select(1, 0);
}

RayTargets TrainingRays::Sample(int64_t count) const {
  const int64_t height = images_.size(1), width = images_.size(2);
  const torch::Device device = images_.device();
  // Drawn on the CPU on every device, so that one seed gives one sequence of rays.
  torch::Tensor pixel = torch::randint(images_.size(0) * height * width, {count}, torch::kInt64).to(device);
  RayTargets batch;
  if (const int64_t guided = count / kGuidedShare; targets_.size() > 0 && guided > 0) {
    const torch::Tensor target = torch::randint(targets_.size(), {guided}, torch::kInt64).to(device);
    pixel.slice(0, 0, guided) = target_pixel_.index_select(0, target);
    batch.distance = torch::full({count}, NAN, images_.options().dtype(torch::kFloat32));
    batch.tolerance = torch::zeros_like(batch.distance);
    batch.distance.slice(0, 0, guided) = targets_.distance.index_select(0, target);
    batch.tolerance.slice(0, 0, guided) = targets_.tolerance.index_select(0, target);
  }
  batch.still = static_cast<int64_t>(still_share_ * static_cast<double>(count));
  if (batch.still > 0) {
    const torch::Tensor place = torch::randint(still_pixel_.size(0), {batch.still}, torch::kInt64).to(device);
    pixel.slice(0, count - batch.still) = still_pixel_.index_select(0, place);
    batch.start = torch::zeros({count}, still_distance_.options());
    batch.start.slice(0, count - batch.still) = kBefore * still_distance_.index_select(0, place);
  }
  const torch::Tensor frame = pixel.div(height * width, "floor");
  const torch::Tensor within = pixel - frame * (height * width);
  const torch::Tensor row = within.div(width, "floor"), column = within - row * width;
  batch.frame = frame;
  batch.rays = RaysThroughPixels(cameras_, frame, torch::stack({column, row}, 1).to(torch::kFloat32) + 0.5);
  batch.target = images_.view({-1, 3}).index_select(0, pixel).to(torch::kFloat32) / 255;
  return batch;
}

}  // namespace editnerf
