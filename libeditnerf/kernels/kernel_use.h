// Which tensors the kernels take, and a way to have plain LibTorch operations instead.
#pragma once

#include <ATen/core/Tensor.h>

#include <initializer_list>

namespace editnerf {

// Float32 in the CPU's memory, or undefined; never while a PlainOperations lives.
bool KernelsTake(const at::Tensor& tensor);
bool KernelsTake(std::initializer_list<at::Tensor> tensors);

// While one lives, all threads evaluate and train fields in plain LibTorch operations, as other devices do: what the
// kernels are compared with.
class PlainOperations {
 public:
  PlainOperations();
  ~PlainOperations();
  PlainOperations(const PlainOperations&) = delete;
  PlainOperations& operator=(const PlainOperations&) = delete;

  static bool Wanted();
};

}  // namespace editnerf
