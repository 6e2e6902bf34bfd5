// The operators of stability_benchmark.h, each in situations in which a careless formulation fails.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace editnerf {

struct ErrorAndBound {
  double error = 0, bound = 0;
};

// What one variant of an operator did in one situation.
struct StabilityRow {
  std::string operation, situation, variant;
  ErrorAndBound value;
  std::optional<ErrorAndBound> gradient;  // none: the variant has no gradient of its own
  bool finite = true;                     // values and gradients, wherever they should be

  bool Passes() const;  // a NaN passes nothing
};

using StabilityRows = std::vector<StabilityRow>;

StabilityRows CompositingStability();
StabilityRows SoftmaxStability();
StabilityRows DensityStability();
StabilityRows RigidMotionStability();
StabilityRows PositionalEncodingStability();
StabilityRows HashEncodingStability();
StabilityRows ProjectionStability();
StabilityRows NetworkStability();
StabilityRows MarchingStability();
StabilityRows FusedPassStability();
StabilityRows DistortionStability();
StabilityRows EarlyStopStability();
StabilityRows LocalFrameStability();
StabilityRows KeyPointWeightStability();
StabilityRows LookUpStability();

// Error against run time of ways to solve dT/ds = -sigma T, from thin to stiff.
struct IntegrationPoint {
  std::string way;
  double thickness = 0;    // optical thickness of the whole ray
  int64_t steps = 0;       // of a ray
  double error = 0;        // of its colour, relative
  double nanoseconds = 0;  // of a sample, processor time
};

std::vector<IntegrationPoint> IntegrationErrors(int64_t repeats, double least_seconds);

}  // namespace editnerf
