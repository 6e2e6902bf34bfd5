#include "libeditnerf/training/adam.h"

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kGrain = 16384;

struct Update {
  double rate, beta1, beta2, epsilon;
  double correction1, correction2;  // 1 - beta^steps
};

template <class T>
void StepOnCpu(const Update& u, bool skip_untouched, int64_t count, const T* gradient, T* parameter, T* first,
               T* second) {
  const T beta1 = static_cast<T>(u.beta1), beta2 = static_cast<T>(u.beta2), epsilon = static_cast<T>(u.epsilon);
  const T rate = static_cast<T>(u.rate / u.correction1), scale = static_cast<T>(1 / std::sqrt(u.correction2));
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const T g = gradient[i];
      if (skip_untouched && g == T(0)) continue;
      first[i] = beta1 * first[i] + (1 - beta1) * g;
      second[i] = beta2 * second[i] + (1 - beta2) * g * g;
      parameter[i] -= rate * first[i] / (std::sqrt(second[i]) * scale + epsilon);
    }
  });
}

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

void LoadInto(const std::map<std::string, torch::Tensor>& state, const std::string& key, torch::Tensor& target) {
  const auto found = state.find(key);
  if (found == state.end()) Throw<CheckpointError>("optimiser state: '{}' is missing", key);
  if (found->second.sizes() != target.sizes()) {
    Throw<CheckpointError>("optimiser state: '{}': expected shape {}, found {}", key, ShapeString(target),
                           ShapeString(found->second));
  }
  target.copy_(found->second);
}

}  // namespace

Adam::Adam(std::vector<AdamGroup> groups, const AdamOptions& options) : options_(options) {
  for (const AdamGroup& group : groups) {
    for (const auto& [name, parameter] : group.parameters) {
      slots_.push_back({name, parameter, torch::zeros_like(parameter).detach(), torch::zeros_like(parameter).detach(),
                        group.learning_rate_factor, group.skip_untouched});
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
    if (slot.parameter.device().is_cpu() && slot.parameter.is_contiguous() && slot.parameter.is_floating_point()) {
      const torch::Tensor packed = gradient.contiguous();
      AT_DISPATCH_FLOATING_TYPES(slot.parameter.scalar_type(), "Adam", [&] {
        StepOnCpu<scalar_t>(update, slot.skip_untouched, packed.numel(), packed.data_ptr<scalar_t>(),
                            slot.parameter.data_ptr<scalar_t>(), slot.first.data_ptr<scalar_t>(),
                            slot.second.data_ptr<scalar_t>());
      });
    } else {
      StepAnywhere(update, slot.skip_untouched, gradient, slot.parameter, slot.first, slot.second);
    }
  }
}

void Adam::ZeroGrad() {
  for (Slot& slot : slots_) slot.parameter.mutable_grad() = torch::Tensor();
}

std::vector<std::pair<std::string, torch::Tensor>> Adam::parameters() const {
  std::vector<std::pair<std::string, torch::Tensor>> parameters;
  for (const Slot& slot : slots_) parameters.emplace_back(slot.name, slot.parameter);
  return parameters;
}

std::map<std::string, torch::Tensor> Adam::State() const {
  std::map<std::string, torch::Tensor> state;
  for (const Slot& slot : slots_) {
    state["first." + slot.name] = slot.first;
    state["second." + slot.name] = slot.second;
  }
  state["steps"] = torch::tensor(steps_, torch::kInt64);
  return state;
}

void Adam::LoadState(const std::map<std::string, torch::Tensor>& state) {
  const torch::NoGradGuard no_grad;
  for (Slot& slot : slots_) {
    LoadInto(state, "first." + slot.name, slot.first);
    LoadInto(state, "second." + slot.name, slot.second);
  }
  torch::Tensor steps = torch::zeros({}, torch::kInt64);
  LoadInto(state, "steps", steps);
  steps_ = steps.item<int64_t>();
}

}  // namespace editnerf
