// Leaves out what a scene does not need: components of the field that the configuration leaves to `auto`, and second
// key points of one part, are decided by short trainings, compared on pixels of the validation frames.
//
// The field begins with none of the components. One after the other is added, trained for some hundred steps, and stays
// where it gains enough, on the mean over two seeds where the first one says so, as runs of the same settings differ.
// So what nobody misses costs nothing, neither time nor the freedom to explain a picture by something that is not
// there. Local frames are another matter: detection has weighed turns against none already, and they change nothing but
// what moves. So they stay, unless pixels where parts are seen lose by them. Key points come first: one that moves as
// another one does stays only where it gains.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/pipeline/key_point_merging.h"
#include "libeditnerf/pipeline/stages.h"

namespace editnerf {

struct ComponentTrial {
  std::string setting;                  // "field.use_view_direction", "key point 3"
  bool on = false;                      // what was decided
  std::optional<double> without, with;  // held-out PSNR in dB, of local frames where parts are seen; empty: not tried
  std::string reason;                   // "+0.41 dB", "no part turns"
  std::optional<int64_t> merged_into;   // of a detected key point that is not on: the one that stands for it, from 0
};

struct ComponentTrials {
  Config config;       // with every component of the training stage decided
  KeyPointMap merged;  // of the detected key points
  std::vector<ComponentTrial> trials;
  double seconds = 0;
};

// Trains train.trial_steps for every open component, and for none, with one seed, with another one where by that a
// component is needed or local frames do harm, and otherwise as the stage would be trained.
// Decided without trials, and said so, where the scene has no validation frames or the stage is too short to pay for
// them. Leaves the random generators alone. Throws Interrupted after Ctrl-C.
ComponentTrials DecideComponents(const Scene& scene, const StageRequest& request, const DetectedKeyPoints& detected);

// The same for the number of ambient coordinates of pretraining, where field.slicing.ambient_dim leaves it open: one,
// and another one as long as it gains. depth: of the static scene, as the stage will have it; may be empty.
ComponentTrials DecideAmbient(const Scene& scene, const StageRequest& request, const DepthTargets& depth);

// RUN/components.json: the trials, for the report.
nlohmann::ordered_json ToJson(const ComponentTrials& trials);

// What became of the detected key points according to such a file; none is merged where it is not there. Throws
// DataError naming the file.
KeyPointMap ReadMerged(const std::filesystem::path& path, int64_t num_key_points);

}  // namespace editnerf
