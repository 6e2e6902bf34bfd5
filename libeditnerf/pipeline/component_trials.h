// Leaves out what a scene does not need: components of the field that the configuration leaves to `auto` are decided by
// short trainings, compared on pixels of the validation frames.
//
// The field begins with none of them. One after the other is added, trained for some hundred steps, and stays where it
// gains more than runs of the same settings differ by. So what nobody misses costs nothing, neither time nor the
// freedom to explain a picture by something that is not there.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/pipeline/stages.h"

namespace editnerf {

struct ComponentTrial {
  std::string setting;                  // "field.use_view_direction"
  bool on = false;                      // what was decided
  std::optional<double> without, with;  // held-out PSNR in dB; empty: not tried
  std::string reason;                   // "+0.41 dB", "no part turns"
};

struct ComponentTrials {
  Config config;  // with every component of the training stage decided
  std::vector<ComponentTrial> trials;
  double seconds = 0;
};

// Trains train.trial_steps for every open component, all with one seed, and otherwise as the stage would be trained.
// Decided without trials, and said so, where the scene has no validation frames or the stage is too short to pay for
// them. Leaves the random generators alone. Throws Interrupted after Ctrl-C.
ComponentTrials DecideComponents(const Scene& scene, const StageRequest& request, const DetectedKeyPoints& detected);

// RUN/components.json: the trials, for the report.
nlohmann::ordered_json ToJson(const ComponentTrials& trials);

}  // namespace editnerf
