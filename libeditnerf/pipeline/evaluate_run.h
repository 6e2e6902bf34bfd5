// The evaluation of a run against a scene: renders what the protocols ask for and measures it.
//
//   reconstruction   validation frames of a state that training saw, from another camera
//   interpolation    validation frames of a state between two training frames, codes and key points blended
//   editing          edit frames: key points moved by the true motion (evaluation/protocols.h), codes of the training
//                    frame with the nearest key points
//
// With them come two baselines that render nothing: "reconstruction_nearest" shows the training image of the same
// state, "editing_nearest" the training image with the nearest key points. Both keep that image's camera.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "libeditnerf/evaluation/evaluation_result.h"
#include "libeditnerf/evaluation/lpips.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

// In the order in which they are evaluated.
const std::vector<std::string>& EvaluationProtocols();

struct EvaluationRequest {
  std::set<std::string> protocols;
  Lpips lpips = nullptr;                   // empty: not measured
  std::filesystem::path pictures;          // folder for PROTOCOL_ID.png, truth on the left; empty: none
  int64_t max_frames = 0;                  // of each protocol, evenly spaced; 0: all
  std::filesystem::path detection_folder;  // with data/detection.json, the key points' reference frames; may lack it
};

// Why `protocol` cannot be evaluated; empty where it can. Throws ConfigError for an unknown name.
std::string ReasonAgainst(const Run& run, const Scene& scene, const std::string& protocol);

// `scene` holds images, and ground truth where there is any; it must be the scene of the run, at the run's image size
// or another. Marks the states to come in the run's occupancy grid. Throws DataError for a protocol with a
// ReasonAgainst it and for another scene, Interrupted after Ctrl-C.
//
// "psnr_moving" is over the ground-truth mask of the frame; frames of "editing" also have "key_point_distance", the
// root mean square distance to the nearest training frame's key points [scene units]. Seconds: "train" (or "pretrain")
// with measurements and checkpoints, "train_only" the optimisation alone.
EvaluationResult EvaluateRun(Run& run, const Scene& scene, const EvaluationRequest& request);

}  // namespace editnerf
