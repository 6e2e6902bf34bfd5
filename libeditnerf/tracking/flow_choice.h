// The optical flow that a configuration asks for.
#pragma once

#include <memory>

#include "libeditnerf/config/config.h"
#include "libeditnerf/tracking/optical_flow.h"

namespace editnerf {

// Throws ConfigError where RAFT is asked for without weights, and DataError naming a file of weights that cannot be
// used (raft/weights.h).
std::unique_ptr<OpticalFlow> MakeOpticalFlow(const FlowConfig& config);

}  // namespace editnerf
