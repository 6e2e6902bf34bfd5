#include "libeditnerf/evaluation/depth_error.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

// Of maps [K, H, W], at the middle pixel of each whole square of `every` pixels.
torch::Tensor Thinned(torch::Tensor maps, int64_t every) {
  for (int64_t axis = 1; axis < 3; ++axis) {
    const int64_t side = maps.size(axis);
    maps = maps.slice(axis, every / 2, side - side % every, every);
  }
  return maps;
}

}  // namespace

std::vector<DepthError> MeasureDepthErrors(const torch::Tensor& depth, const Scene& scene,
                                           const std::vector<int64_t>& rows, int64_t every) {
  if (!scene.truth) Throw<DataError>("scene '{}': measuring depth takes ground truth, and it has none", scene.name);
  const auto frames = torch::tensor(scene.train, torch::kInt64).index_select(0, torch::tensor(rows, torch::kInt64));
  const auto truth = Thinned(scene.truth->depth.index_select(0, frames), every);
  const auto mask = Thinned(scene.truth->mask.index_select(0, frames), every);
  CheckShape(depth, {truth.size(0), truth.size(1), truth.size(2)}, "depth");
  const auto error = ((depth.to(torch::kFloat32) - truth).abs() / truth).nan_to_num(1.0);
  std::vector<DepthError> errors;
  for (size_t part = 0; part <= scene.truth->objects.size(); ++part) {
    const auto here = torch::logical_and(mask == static_cast<int64_t>(part), truth.isfinite());
    const auto own = std::get<0>(error.masked_select(here).sort());
    const int64_t pixels = own.size(0);
    if (pixels == 0) continue;
    const auto at = [&](double share) {
      return own[static_cast<int64_t>(share * static_cast<double>(pixels - 1))].item<double>();
    };
    errors.push_back({part == 0 ? "static" : scene.truth->objects[part - 1], at(0.5), at(0.9), pixels});
  }
  return errors;
}

std::vector<DepthError> MeasureDepthTargets(const Scene& scene, const DepthTargets& targets) {
  std::vector<DepthError> errors;
  if (!scene.truth || targets.size() == 0) return errors;
  const torch::Tensor row = torch::tensor(scene.train, torch::kInt64).index_select(0, targets.frame);
  const torch::Tensor u = targets.pixel.select(1, 0), v = targets.pixel.select(1, 1);
  const torch::Tensor truth = scene.truth->depth.index({row, v, u}), mask = scene.truth->mask.index({row, v, u});
  const torch::Tensor error = (targets.distance / truth - 1).abs();
  for (size_t part = 0; part <= scene.truth->objects.size(); ++part) {
    const torch::Tensor own = error.masked_select(mask == static_cast<int64_t>(part));
    if (own.numel() == 0) continue;
    errors.push_back({part == 0 ? "static" : scene.truth->objects[part - 1], own.quantile(0.5).item<double>(),
                      own.quantile(0.9).item<double>(), own.numel()});
  }
  return errors;
}

void LogDepthTargetErrors(const Scene& scene, const DepthTargets& targets) {
  for (const DepthError& error : MeasureDepthTargets(scene, targets)) {
    LogInfo("  on {}: {} places, median error {:.2g} %, 90th percentile {:.2g} %",
            error.part == "static" ? "the static scene" : error.part, error.pixels, 100 * error.median,
            100 * error.percentile90);
  }
}

}  // namespace editnerf
