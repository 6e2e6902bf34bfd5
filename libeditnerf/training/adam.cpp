#include "libeditnerf/training/adam.h"

#include <cmath>

#include "libeditnerf/kernels/adam_step.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "libeditnerf/training/saved_state.h"

namespace editnerf {
namespace {

struct Update {
  double rate, beta1, beta2, epsilon;
  double correction1, correction2;  // 1 - beta^steps
};

bool IsPlain(const torch::Tensor& tensor) { return KernelsTake(tensor) && tensor.is_contiguous(); }

void StepAnywhere(const Update& u, bool skip_untouched, const torch::Tensor& gradient, torch::Tensor& parameter,
                  torch::Tensor& first, torch::Tensor& second) {
  torch::Tensor touched;
  const torch::Tensor old_first = skip_untouched ? first.clone() : torch::Tensor();
  const torch::Tensor old_second = skip_untouched ? second.clone() : torch::Tensor();
  first.mul_(u.beta1).add_(gradient, 1 - u.beta1);
  second.mul_(u.beta2).addcmul_(gradient, gradient, 1 - u.beta2);
  torch::Tensor change = first / (second.sqrt() / std::sqrt(u.correction2) + u.epsilon) * (u.rate / u.correction1);
  if (skip_untouched) {
    touched = gradient.ne(0);
    first.copy_(torch::where(touched, first, old_first));
    second.copy_(torch::where(touched, second, old_second));
    change = torch::where(touched, change, torch::zeros_like(change));
  }
  parameter.sub_(change);
}

}  // namespace

Adam::Adam(const std::vector<AdamGroup>& groups, const AdamOptions& options) : options_(options) {
  for (const AdamGroup& group : groups) {
    for (const auto& [name, parameter] : group.parameters) {
      slots_.push_back({name, parameter, torch::zeros_like(parameter).detach(), torch::zeros_like(parameter).detach(),
                        group.learning_rate_factor, group.skip_untouched, group.decay, group.settle_after});
    }
  }
}

void Adam::Step(double learning_rate) {
  const torch::NoGradGuard no_grad;
  ++steps_;
  Update update{0, options_.beta1, options_.beta2, options_.epsilon, 0, 0};
  update.correction1 = 1 - std::pow(options_.beta1, static_cast<double>(steps_));
  update.correction2 = 1 - std::pow(options_.beta2, static_cast<double>(steps_));
  for (Slot& slot : slots_) {
    const torch::Tensor gradient = slot.parameter.grad();
    if (!gradient.defined()) continue;
    update.rate = learning_rate * slot.factor;
    if (slot.settle_after > 0 && steps_ > slot.settle_after) {
      update.rate *= static_cast<double>(slot.settle_after) / static_cast<double>(steps_);
    }
    if (slot.decay > 0) slot.parameter.mul_(1 - update.rate * slot.decay);
    if (!IsPlain(slot.parameter) || !IsPlain(gradient)) {
      StepAnywhere(update, slot.skip_untouched, gradient, slot.parameter, slot.first, slot.second);
      continue;
    }
    AdamUpdate plain;
    plain.beta1 = static_cast<float>(update.beta1), plain.beta2 = static_cast<float>(update.beta2);
    plain.epsilon = static_cast<float>(update.epsilon);
    plain.rate = static_cast<float>(update.rate / update.correction1);
    plain.scale = static_cast<float>(1 / std::sqrt(update.correction2));
    float *const g = gradient.data_ptr<float>(), *const x = slot.parameter.data_ptr<float>();
    float *const first = slot.first.data_ptr<float>(), *const second = slot.second.data_ptr<float>();
    if (slot.skip_untouched) {
      SparseAdamStep(plain, gradient.numel(), g, x, first, second);
      slot.cleared = true;
    } else {
      AdamStep(plain, gradient.numel(), g, x, first, second);
    }
    slot.parameter.unsafeGetTensorImpl()->bump_version();  // as LibTorch's own operations in place do
  }
}

void Adam::ZeroGrad() {
  for (Slot& slot : slots_) {
    torch::Tensor& gradient = slot.parameter.mutable_grad();
    if (!slot.skip_untouched) {
      gradient = torch::Tensor();
    } else if (gradient.defined() && !slot.cleared) {
      gradient.detach_().zero_();
    }
    slot.cleared = false;
  }
}

std::vector<std::pair<std::string, torch::Tensor>> Adam::parameters() const {
  std::vector<std::pair<std::string, torch::Tensor>> parameters;
  for (const Slot& slot : slots_) parameters.emplace_back(slot.name, slot.parameter);
  return parameters;
}

SavedState Adam::State() const {
  SavedState state;
  for (const Slot& slot : slots_) {
    state["first." + slot.name] = slot.first;
    state["second." + slot.name] = slot.second;
  }
  state["steps"] = torch::tensor(steps_, torch::kInt64);
  return state;
}

void Adam::LoadState(const SavedState& state) {
  const torch::NoGradGuard no_grad;
  for (Slot& slot : slots_) {
    LoadInto(state, "first." + slot.name, slot.first);
    LoadInto(state, "second." + slot.name, slot.second);
  }
  const torch::Tensor steps = torch::zeros({}, torch::kInt64);
  LoadInto(state, "steps", steps);
  steps_ = steps.item<int64_t>();
}

}  // namespace editnerf
