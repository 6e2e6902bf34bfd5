// The whole way in one call: from a video, a folder of images or a scene folder to an editable scene and its report.
//
//   WORK/scene        scene folder; of a given one links to its files, beside what detection adds
//   WORK/pretrained   run of the HyperNeRF stage
//   WORK/run          run of the editable field
//   WORK/report       index.html, edited.mp4, scores.json, pictures
//   WORK/stages.json  seconds of every finished stage: those are skipped when the call is repeated
//   WORK/config.yaml  the configuration that all of it was made with
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>

#include "libeditnerf/config/config.h"

namespace editnerf {

struct WholeWayRequest {
  std::filesystem::path input;
  std::filesystem::path work;
  Config config;
  torch::Device device = torch::kCPU;
  double time_budget = 0;    // seconds for everything that is still to do (at least 60 % of them after
                             // the poses, whose time nobody can set); 0: what the configuration says
  int64_t max_frames = 200;  // of a video
  int64_t seed = 1, threads = 0;
  std::string command;  // for the report
};

// Throws ConfigError where WORK was begun with another configuration, Interrupted after Ctrl-C (repeat the call to go
// on), and whatever the stages throw.
void RunWholeWay(const WholeWayRequest& request);

}  // namespace editnerf
