#include "libeditnerf/tracking/flow_choice.h"

#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/tracking/flow_from_flow.h"
#include "libeditnerf/tracking/raft/weights.h"
#include "libeditnerf/tracking/raft_flow.h"

namespace editnerf {

std::unique_ptr<OpticalFlow> MakeOpticalFlow(const FlowConfig& config) {
  auto dis = std::make_unique<DisFlow>();
  if (config.method == "dis" || (config.method == "auto" && config.weights.empty())) return dis;
  if (config.weights.empty()) Throw<ConfigError>("flow.method is raft, which takes a file in flow.weights");
  RaftFlowOptions options;
  options.iterations = config.iterations;
  options.enlarge = config.enlarge;
  auto raft = std::make_unique<RaftFlow>(LoadRaft(config.weights), options);
  if (!config.refine) return raft;
  return std::make_unique<FlowFromFlow>(std::move(raft), std::move(dis));
}

}  // namespace editnerf
