#include "libeditnerf/training/schedule.h"

#include <algorithm>
#include <cmath>

namespace editnerf {

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

}  // namespace editnerf
