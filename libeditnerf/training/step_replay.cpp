#include "libeditnerf/training/step_replay.h"

#include <fmt/format.h>
#include <torch/types.h>

#include <cmath>
#include <limits>

#include "libeditnerf/training/step_input.h"
#include "libeditnerf/training/trainer.h"

namespace editnerf {

StepReplay ReplayStep(const std::filesystem::path& folder, torch::Device device) {
  StoredStep stored = LoadStep(folder, device);
  StepReplay replay;
  replay.step = stored.run.counters.step;
  for (const auto& item : stored.run.field->named_parameters()) {
    if (!item.value().isfinite().all().item<bool>()) replay.weights.push_back(item.key());
  }
  // The rays are there already: a trainer that draws none needs no images.
  Scene scene = stored.run.scene;
  scene.val.clear();
  scene.images = torch::zeros({1, 1, 1, 3}, torch::kUInt8)
                     .expand({static_cast<int64_t>(scene.frames.size()), scene.frames.at(0).camera.height,
                              scene.frames.at(0).camera.width, 3});
  Trainer trainer(std::move(stored.run), scene, std::move(stored.supervision), {});
  replay.verdict = trainer.Replay(stored.input);
  return replay;
}

std::string ToText(const StepReplay& replay) {
  std::string text = fmt::format("step {}\n", replay.step);
  const auto add = [&](const std::string& name, double value) {
    text += fmt::format("{:<48} {:12.5g}{}\n", name, value, std::isfinite(value) ? "" : "  not finite");
  };
  for (const auto& [name, value] : replay.verdict.losses) add("loss " + name, value);
  for (const auto& [name, value] : replay.verdict.gradients) add("gradient of " + name, value);
  add("gradient of all", replay.verdict.gradient_norm);
  const auto names = [](const std::vector<std::string>& list) {
    return list.empty() ? std::string("none") : ListOf(list, std::numeric_limits<size_t>::max());
  };
  text += "not finite before the step: " + names(replay.weights) + "\n";
  return text + "not finite in the step: " + names(replay.verdict.not_finite) + "\n";
}

}  // namespace editnerf
