#include "libeditnerf/training/training_rays.h"

#include <cmath>

#include "libeditnerf/base/parallel.h"

namespace editnerf {
namespace {

constexpr int64_t kGuidedShare = 4;  // one in so many rays goes through a pixel of known distance
constexpr double kBefore = 0.98;     // share of the distance to a known place, before which other parts may move
constexpr int64_t kRayGrain = 256;   // rays that are worth another thread

void Put(const Vec3& value, float* to) {
  to[0] = static_cast<float>(value.x), to[1] = static_cast<float>(value.y), to[2] = static_cast<float>(value.z);
}

}  // namespace

TrainingRays::TrainingRays(const Scene& scene, const std::vector<int64_t>& frames, torch::Device device) {
  for (const int64_t frame : frames) each_camera_.push_back(scene.frames[static_cast<size_t>(frame)].camera);
  cameras_ = StackCameras(each_camera_, torch::kFloat32, device);
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

void TrainingRays::SetKnownPlaces(const DepthTargets& places, double still_share, double carried_share,
                                  bool any_light) {
  still_ = carried_ = {};
  if (places.size() == 0) return;
  torch::Tensor still = places.key_point == kStandsStill;
  if (any_light) still = still | (places.key_point == kOtherLight);
  still_ = Where(places, still, still_share);
  carried_ = Where(places, places.key_point >= 0, carried_share);
}

void TrainingRays::DrawByError(double share) {
  errors_.emplace(images_.size(0), images_.size(1), images_.size(2), share);
}

void TrainingRays::Learn(const RayTargets& batch, const torch::Tensor& missed) {
  if (!errors_) return;
  const int64_t in_their_state = batch.pixel.size(0) - batch.drawn;
  errors_->Learn(batch.pixel.slice(0, 0, in_their_state).cpu(), missed.slice(0, 0, in_their_state).cpu());
}

TrainingRays::KnownPlaces TrainingRays::Where(const DepthTargets& places, const torch::Tensor& chosen,
                                              double share) const {
  const torch::Tensor row = chosen.nonzero().squeeze(1);
  if (row.numel() == 0) return {};
  const auto rows = [&](const torch::Tensor& all) { return all.index_select(0, row).to(images_.device()); };
  return {share, rows(PixelsOf(places)), rows(places.distance), rows(places.key_point)};
}

torch::Tensor TrainingRays::Positions(const DepthTargets& places) const {
  const Rays rays = Through(PixelsOf(places).to(images_.device())).rays;
  return rays.origin + rays.direction * places.distance.to(images_.device()).unsqueeze(1);
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
  const int64_t guided = targets_.size() > 0 ? count / kGuidedShare : 0;
  if (guided > 0) {
    const torch::Tensor target = torch::randint(targets_.size(), {guided}, torch::kInt64).to(device);
    pixel.slice(0, 0, guided) = target_pixel_.index_select(0, target);
    batch.distance = torch::full({count}, NAN, images_.options().dtype(torch::kFloat32));
    batch.tolerance = torch::zeros_like(batch.distance);
    batch.distance.slice(0, 0, guided) = targets_.distance.index_select(0, target);
    batch.tolerance.slice(0, 0, guided) = targets_.tolerance.index_select(0, target);
  }
  for (const KnownPlaces* places : {&still_, &carried_}) {
    const auto share = static_cast<int64_t>(places->share * static_cast<double>(count));
    if (share == 0) continue;
    const torch::Tensor place = torch::randint(places->pixel.size(0), {share}, torch::kInt64).to(device);
    const int64_t end = count - batch.drawn;
    pixel.slice(0, end - share, end) = places->pixel.index_select(0, place);
    if (batch.drawn == 0) batch.start = torch::zeros({count}, places->distance.options());
    batch.start.slice(0, end - share, end) = kBefore * places->distance.index_select(0, place);
    const torch::Tensor carrier = places->key_point.index_select(0, place);
    batch.carrier = batch.drawn == 0 ? carrier : torch::cat({carrier, batch.carrier});
    batch.drawn += share;
  }
  if (const int64_t others = count - guided - batch.drawn; errors_) {
    const torch::Tensor of_others = pixel.slice(0, guided, guided + others);
    const auto by_error = static_cast<int64_t>(errors_->share() * static_cast<double>(others));
    of_others.slice(0, 0, by_error).copy_(errors_->Draw(by_error));
    batch.emphasis = torch::ones({count}, torch::kFloat32);
    batch.emphasis.slice(0, guided, guided + others) = errors_->Emphasis(of_others.cpu());
    batch.emphasis = batch.emphasis.to(device);
  }
  batch.pixel = pixel;
  RayTargets seen = Through(pixel);
  batch.frame = seen.frame;
  batch.rays = seen.rays;
  batch.target = seen.target;
  if (batch.drawn > 0) {
    const int64_t first = count - batch.drawn;
    const torch::Tensor distance = batch.start.slice(0, first) / kBefore;
    batch.place = batch.rays.origin.slice(0, first) + batch.rays.direction.slice(0, first) * distance.unsqueeze(1);
  }
  return batch;
}

RayTargets TrainingRays::Through(const torch::Tensor& pixel) const {
  const int64_t height = images_.size(1), width = images_.size(2);
  RayTargets seen;
  if (!images_.is_cpu()) {
    seen.frame = pixel.div(height * width, "floor");
    const torch::Tensor within = pixel - seen.frame * (height * width);
    const torch::Tensor row = within.div(width, "floor"), column = within - row * width;
    seen.rays = RaysThroughPixels(cameras_, seen.frame, torch::stack({column, row}, 1).to(torch::kFloat32) + 0.5);
    seen.target = images_.view({-1, 3}).index_select(0, pixel).to(torch::kFloat32) / 255;
    return seen;
  }
  // In one pass: thirty small operations would take longer than all the rest of a step that is not spread over threads.
  const int64_t count = pixel.size(0);
  seen.frame = torch::empty_like(pixel);
  for (torch::Tensor* part : {&seen.rays.origin, &seen.rays.direction, &seen.target})
    *part = torch::empty({count, 3}, torch::kFloat32);
  const int64_t* const pixels = pixel.data_ptr<int64_t>();
  const uint8_t* const images = images_.data_ptr<uint8_t>();
  int64_t* const frames = seen.frame.data_ptr<int64_t>();
  float* const origins = seen.rays.origin.data_ptr<float>();
  float* const directions = seen.rays.direction.data_ptr<float>();
  float* const targets = seen.target.data_ptr<float>();
  ParallelFor(count, kRayGrain, [&](int64_t begin, int64_t end) {
    for (int64_t ray = begin; ray < end; ++ray) {
      const int64_t frame = pixels[ray] / (height * width), within = pixels[ray] % (height * width);
      const int64_t row = within / width, column = within % width;
      const Camera& camera = each_camera_[static_cast<size_t>(frame)];
      const Vec3 direction = camera.DirectionThrough(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
      frames[ray] = frame;
      Put(camera.position, origins + 3 * ray);
      Put(direction, directions + 3 * ray);
      for (int64_t i = 0; i < 3; ++i) targets[3 * ray + i] = static_cast<float>(images[3 * pixels[ray] + i]) / 255;
    }
  });
  return seen;
}

}  // namespace editnerf
