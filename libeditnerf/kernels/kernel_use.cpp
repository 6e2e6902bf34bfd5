#include "libeditnerf/kernels/kernel_use.h"

#include <algorithm>
#include <atomic>

namespace editnerf {
namespace {

std::atomic<int> plain_operations{0};

}  // namespace

bool KernelsTake(const at::Tensor& tensor) {
  return !tensor.defined() || (tensor.is_cpu() && tensor.scalar_type() == at::kFloat && !PlainOperations::Wanted());
}

bool KernelsTake(std::initializer_list<at::Tensor> tensors) {
  return std::all_of(tensors.begin(), tensors.end(), [](const at::Tensor& tensor) { return KernelsTake(tensor); });
}

PlainOperations::PlainOperations() { ++plain_operations; }
PlainOperations::~PlainOperations() { --plain_operations; }
bool PlainOperations::Wanted() { return plain_operations.load(std::memory_order_relaxed) > 0; }

}  // namespace editnerf
