#include "libeditnerf/benchmarks/ablation_ladder.h"

#include <torch/types.h>

namespace editnerf {

DetectionConfig VolumeDetection(const DetectionConfig& config, int64_t count) {
  DetectionConfig plain = config;
  plain.rigid_parts = false;
  plain.refine = false;
  plain.count = count;
  return plain;
}

std::vector<LadderStep> AblationLadder(const Config& config, const LadderKeyPoints& volume,
                                       const DetectedKeyPoints& refined) {
  std::vector<LadderStep> steps;
  Config plain = config;
  StageConfig& train = plain.train;
  train.lambda_motion = train.lambda_geometry = train.lambda_depth = 0;
  train.still_share = train.carried_share = 0;
  train.key_point_learning_rate = 1;  // they have a way to go
  train.settle_after = 0;
  const auto without_turns = [](DetectedKeyPoints detected) {
    detected.turns = torch::Tensor();
    return detected;
  };
  const StageConfig paper;  // its weights of the losses are the defaults
  const DetectedKeyPoints propagated = without_turns(volume.detected);
  DetectedKeyPoints standing = propagated;
  standing.tracks = volume.reference.to(propagated.tracks.options()).expand_as(propagated.tracks).contiguous();

  steps.push_back({"base", "no supervision of the key points", true, plain, standing});
  train.lambda_motion = paper.lambda_motion;
  steps.push_back({"motion", "+ motion loss", true, plain, standing});
  train.lambda_geometry = paper.lambda_geometry;
  steps.push_back({"geometry", "+ geometry loss", true, plain, standing});
  steps.push_back({"initialisation", "+ initialisation (the paper's method)", true, plain, propagated});
  // From here on as configured: depth maps that are wrong where parts move would pull on tracks that are better.
  Config ours = config;
  ours.train.still_share = ours.train.carried_share = 0;
  steps.push_back({"refinement", "+ rigid parts, refined tracks", false, ours, without_turns(refined)});
  if (refined.turns.defined()) {
    steps.push_back({"local-frames", "+ local frames", false, config, refined});
  } else {
    steps.push_back({"places", "+ known places", false, config, refined});
  }
  return steps;
}

}  // namespace editnerf
