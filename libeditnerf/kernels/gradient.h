// The gradient of a leaf as memory that kernels add to.
#pragma once

#include <ATen/Functions.h>
#include <ATen/core/Tensor.h>

namespace editnerf {

// Data of parameter.grad(), float32 and contiguous; zeros where there was none.
inline float* GradientOf(const at::Tensor& parameter) {
  at::Tensor& gradient = parameter.mutable_grad();
  if (!gradient.defined()) gradient = at::zeros_like(parameter.detach(), at::MemoryFormat::Contiguous);
  return gradient.data_ptr<float>();
}

}  // namespace editnerf
