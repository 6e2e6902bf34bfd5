// The paper's ablation (EditableNeRF, table 3) step by step, and on from its last step to what is the default here.
#pragma once

#include <torch/types.h>

#include <string>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/pipeline/stages.h"

namespace editnerf {

struct LadderStep {
  std::string name;  // "motion": also of a folder
  std::string description;
  bool from_volume = false;  // which detection its key points are from
  Config config;
  DetectedKeyPoints detected;
};

// What the detection of a ladder found, and where.
struct LadderKeyPoints {
  DetectedKeyPoints detected;
  torch::Tensor reference;  // [N, 3], scene units: where each was found, in its reference frame
};

// The configuration of the paper's detection: maxima of the volume, `count` of them, propagated and not refined.
DetectionConfig VolumeDetection(const DetectionConfig& config, int64_t count);

// Every step adds one thing to the one before:
//   base            key points that begin where they were found, the same in every frame, and only the pictures to say
//                   where they go
//   motion          the motion loss
//   geometry        the geometry loss
//   initialisation  tracks propagated by flow and depth; the paper's method
//   refinement      key points on rigid parts and tracks refined by least squares; not in the paper, as all below
//   local-frames    turns of the parts on hinges, where `refined` has any; otherwise
//   places          rays through places that stand still or go along with a key point, which turning parts do not get
// `config` is what the last one takes as it is.
std::vector<LadderStep> AblationLadder(const Config& config, const LadderKeyPoints& volume,
                                       const DetectedKeyPoints& refined);

}  // namespace editnerf
