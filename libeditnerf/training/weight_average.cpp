#include "libeditnerf/training/weight_average.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <stdexcept>

namespace editnerf {
namespace {

constexpr double kEta = 8;

}  // namespace

WeightAverage::WeightAverage(std::vector<std::pair<std::string, torch::Tensor>> weights)
    : weights_(std::move(weights)) {
  for (auto& [name, tensor] : weights_) tensor = tensor.detach();
}

void WeightAverage::Add() {
  if (shown_) throw std::logic_error("WeightAverage::Add: the mean is shown");
  const torch::NoGradGuard no_grad;
  ++count_;
  if (others_.empty()) {
    for (const auto& [name, tensor] : weights_) others_.push_back(tensor.clone());
    return;
  }
  const double share = (kEta + 1) / (kEta + static_cast<double>(count_));
  for (size_t i = 0; i < weights_.size(); ++i) others_[i].lerp_(weights_[i].second, share);
}

void WeightAverage::Restart() {
  Hide();
  others_.clear();
  count_ = 0;
}

void WeightAverage::Exchange() {
  const torch::NoGradGuard no_grad;
  // In place, so that whatever was derived from a tensor sees by its version that it has changed.
  for (size_t i = 0; i < weights_.size(); ++i) {
    const torch::Tensor old = weights_[i].second.clone();
    weights_[i].second.copy_(others_[i]);
    others_[i] = old;
  }
  shown_ = !shown_;
}

void WeightAverage::Show() {
  if (shown_ || count_ == 0) return;
  const bool finite = std::all_of(others_.begin(), others_.end(),
                                  [](const torch::Tensor& mean) { return mean.isfinite().all().item<bool>(); });
  if (!finite) return Restart();
  Exchange();
}

void WeightAverage::Hide() {
  if (shown_) Exchange();
}

SavedState WeightAverage::State() const {
  SavedState state;
  if (count_ == 0) return state;
  if (!shown_) throw std::logic_error("WeightAverage::State: the mean is not shown");
  for (size_t i = 0; i < weights_.size(); ++i) state["weights." + weights_[i].first] = others_[i];
  state["count"] = torch::tensor(count_, torch::kInt64);
  return state;
}

void WeightAverage::LoadState(const SavedState& state) {
  Restart();
  if (state.empty()) return;
  const torch::NoGradGuard no_grad;
  const torch::Tensor count = torch::zeros({}, torch::kInt64);
  LoadInto(state, "count", count);
  std::vector<torch::Tensor> behind;
  for (const auto& [name, tensor] : weights_) {
    behind.push_back(torch::empty_like(tensor));
    LoadInto(state, "weights." + name, behind.back());
  }
  others_ = std::move(behind);
  count_ = count.item<int64_t>();
  shown_ = true;
  Hide();
}

}  // namespace editnerf
