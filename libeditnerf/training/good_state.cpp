#include "libeditnerf/training/good_state.h"

#include <torch/nn/module.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>

namespace editnerf {
namespace {

const std::string kAdam = "adam.";

// The run's own tensors: what is written to them is written to the run.
SavedState TensorsOf(const Run& run) {
  SavedState tensors;
  const auto collect = [&](const torch::nn::Module& module, const std::string& prefix) {
    for (const auto& item : module.named_parameters()) tensors[prefix + item.key()] = item.value().detach();
    for (const auto& item : module.named_buffers()) tensors[prefix + item.key()] = item.value();
  };
  collect(*run.field, "field.");
  collect(*run.renderer, "renderer.");
  return tensors;
}

}  // namespace

void GoodState::Keep(const Run& run, const Adam& adam) {
  const torch::NoGradGuard no_grad;
  SavedState now = TensorsOf(run);
  PutUnder(kAdam, adam.State(), &now);
  for (const auto& [name, tensor] : now) {
    torch::Tensor& kept = tensors_[name];
    if (kept.defined()) {
      kept.copy_(tensor);
    } else {
      kept = tensor.clone();
    }
  }
  step_ = run.counters.step;
}

void GoodState::Restore(Run* run, Adam* adam) const {
  const torch::NoGradGuard no_grad;
  for (auto& [name, tensor] : TensorsOf(*run)) tensor.copy_(tensors_.at(name));
  adam->LoadState(Under(kAdam, tensors_));
}

bool HasFiniteWeights(const HyperspaceField& field) {
  const torch::NoGradGuard no_grad;
  const auto parameters = field.parameters();
  return std::all_of(parameters.begin(), parameters.end(),
                     [](const torch::Tensor& weights) { return weights.isfinite().all().item<bool>(); });
}

}  // namespace editnerf
