#include "libeditnerf/training/step_guard.h"

#include <torch/torch.h>

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
  std::vector<std::string> names;
  std::vector<torch::Tensor> values;
  for (const auto& [name, loss] : losses) {
    names.push_back(name);
    values.push_back(loss.detach().reshape({}).to(torch::kFloat64));
  }
  for (const auto& [name, parameter] : parameters) {
    if (!parameter.grad().defined()) continue;
    names.push_back("gradient of " + name);
    values.push_back(Norm(parameter.grad()));
  }

  StepVerdict verdict;
  double squares = 0;
  const auto all = values.empty() ? torch::zeros({0}, torch::kFloat64) : torch::stack(values).cpu();
  const auto value = all.accessor<double, 1>();
  for (size_t i = 0; i < names.size(); ++i) {
    const double x = value[static_cast<int64_t>(i)];
    if (i < losses.size()) {
      verdict.losses.push_back(x);
    } else {
      squares += x * x;
    }
    if (std::isfinite(x)) continue;
    verdict.take = false;
    verdict.not_finite += (verdict.not_finite.empty() ? "" : ", ") + names[i];
    ++failures_[names[i]];
  }
  verdict.gradient_norm = std::sqrt(squares);
  if (verdict.take) {
    in_a_row_ = 0;
    return verdict;
  }
  ++skipped_;
  if (++in_a_row_ >= max_failures_) {
    verdict.roll_back = true;
    in_a_row_ = 0;
  }
  return verdict;
}

}  // namespace editnerf
