#include "libeditnerf/training/step_guard.h"

#include <fmt/format.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/kernels/adam_step.h"
#include "libeditnerf/kernels/kernel_use.h"

namespace editnerf {
namespace {

torch::Tensor Norm(const torch::Tensor& gradient) {
  if (!KernelsTake(gradient) || !gradient.is_contiguous()) return gradient.norm().to(torch::kFloat64);
  return torch::tensor(std::sqrt(SumOfSquares(gradient.data_ptr<float>(), gradient.numel())), torch::kFloat64);
}

}  // namespace

StepVerdict StepGuard::Check(const NamedTensors& losses, const NamedTensors& parameters) {
  torch::NoGradGuard no_grad;
  StepVerdict verdict;
  std::vector<torch::Tensor> values;
  for (const auto& [name, loss] : losses) {
    verdict.losses.emplace_back(name, 0.0);
    values.push_back(loss.detach().reshape({}).to(torch::kFloat64));
  }
  for (const auto& [name, parameter] : parameters) {
    if (!parameter.grad().defined()) continue;
    verdict.gradients.emplace_back(name, 0.0);
    values.push_back(Norm(parameter.grad()));
  }

  const auto all = values.empty() ? torch::zeros({0}, torch::kFloat64) : torch::stack(values).cpu();
  const double* value = all.data_ptr<double>();
  const auto take_over = [&](NamedValues* terms, const char* prefix) {
    for (auto& [name, x] : *terms) {
      x = *value++;
      if (!std::isfinite(x)) verdict.not_finite.push_back(prefix + name);
    }
  };
  take_over(&verdict.losses, "");
  take_over(&verdict.gradients, "gradient of ");
  for (const auto& [name, norm] : verdict.gradients) verdict.gradient_norm = std::hypot(verdict.gradient_norm, norm);
  verdict.take = verdict.not_finite.empty();
  if (verdict.take) {
    in_a_row_ = 0;
  } else if (++in_a_row_ >= max_failures_) {
    verdict.roll_back = true;
    in_a_row_ = 0;
  }
  return verdict;
}

std::string ListOf(const std::vector<std::string>& names, size_t most) {
  const size_t listed = std::min(names.size(), most);
  std::string text;
  for (size_t i = 0; i < listed; ++i) text += (i == 0 ? "" : ", ") + names[i];
  return listed == names.size() ? text : text + fmt::format(" and {} more", names.size() - listed);
}

}  // namespace editnerf
