#include "libeditnerf/training/schedule.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>

namespace editnerf {
namespace {

// A random background makes surfaces opaque, but from the first step on it would build a wall of fog before the
// cameras. Until then the images' mean colour stands behind everything: on black, a thin fog would first have to become
// white, where its colours saturate and learn no more.
constexpr int64_t kMeanBackgroundSteps = 100, kRandomBackgroundStep = 400;

}  // namespace

double StageProgress(const StageConfig& config, int64_t step, double seconds) {
  double progress = static_cast<double>(step) / static_cast<double>(config.steps);
  if (config.seconds > 0) progress = std::max(progress, seconds / config.seconds);
  return std::clamp(progress, 0.0, 1.0);
}

double ExponentialSchedule(double initial, double final, double progress) {
  return initial * std::pow(final / initial, std::clamp(progress, 0.0, 1.0));
}

double LinearRamp(int64_t step, int64_t delay, int64_t steps) {
  if (step < delay) return 0;
  if (step >= delay + steps) return 1;
  return static_cast<double>(step - delay) / static_cast<double>(steps);
}

int64_t MarchStepsAt(int64_t step, int64_t configured) {
  if (step < 300) return std::max<int64_t>(2, configured / 4);
  return step < 1000 ? std::max<int64_t>(2, configured / 2) : configured;
}

torch::Tensor BackgroundOf(const torch::Tensor& mean_color, int64_t rays, int64_t step) {
  const double share = std::clamp(static_cast<double>(step - kMeanBackgroundSteps) /
                                      static_cast<double>(kRandomBackgroundStep - kMeanBackgroundSteps),
                                  0.0, 1.0);
  const torch::Tensor random = torch::rand({rays, 3}).to(mean_color.device());
  return torch::lerp(mean_color.expand({rays, 3}), random, share);
}

}  // namespace editnerf
